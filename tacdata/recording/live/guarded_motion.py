"""Motion that stops as soon as any stream reports a fault."""

from __future__ import annotations

import threading
import time

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import MotionController
from tacdata.errors import TacdataError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.recording.motion.move_times import Command
from tacdata.recording.motion.press_steps import Position, Step

WATCH = 0.02
"""Interval at which the motion is watched for faults and Ctrl-C [s of real time]."""
MARGIN = 15.0
"""Time allowed for coming to rest at the end of a path before it counts as hung [s of the host's clock]."""
LETTING_GO = 10.0
"""Time allowed for a stopped motion's thread to end [s of real time]."""


class GuardedMotion:
    """Carries out steps in a thread of its own, so that the calling thread can stop them at any moment."""

    def __init__(self, cnc: MotionController, clock: Clock, interruption: Interruption | None = None) -> None:
        """Drive ``cnc``; nothing moves before `drive`, which looks for signals that the interruption holds back."""
        self._cnc, self._clock, self._interruption = cnc, clock, interruption or Interruption()
        self._halted = threading.Event()
        self._rest: Position | None = None  # where it stands after a stop; None: it runs, or does not obey
        self._why = "nothing was stopped"

    def stop(self) -> None:
        """Send a feed hold now, and no further step. Thread-safe."""
        self._halted.set()
        self._cnc.feed_hold()

    def drive(
        self, path: tuple[Step, ...], start: Position, streams: RigStreams, writer: EpisodeWriter | None
    ) -> Position:
        """Carry out the steps and return where they end [mm].

        Args:
            path: The steps; each move starts from rest.
            start: Where the guide stands [mm].
            streams: Watched for faults.
            writer: Receives every acknowledged step.

        Raises:
            DeviceError: On a fault, after a feed hold and dropping the queue.
            KeyboardInterrupt: On Ctrl-C, after the same.
        """
        failure: list[BaseException] = []
        work = threading.Thread(target=self._carry_out, args=(path, start, writer, failure), daemon=True)
        try:
            work.start()
            while work.is_alive():
                work.join(WATCH)
                self._interruption.check()
                if streams.fault:
                    break
            if failure and streams.fault is None:
                time.sleep(WATCH)  # a stream that stopped the motion is about to give the reason
            if streams.fault or failure:
                raise streams.fault or failure[0]
        except BaseException:
            self.stop()
            self._let_go(work)
            raise
        return next((step.target for step in reversed(path) if step.target), start)

    def _let_go(self, work: threading.Thread) -> None:
        """After a stop: wait until the motion's thread sends nothing more, then empty the controller's queue."""
        self._rest = None
        work.join(LETTING_GO)
        if work.is_alive():
            self._why = "the motion's thread does not end"
            return
        try:
            self._rest = self._cnc.abandon()
        except TacdataError as error:
            self._why = error.given

    def _carry_out(
        self,
        path: tuple[Step, ...],
        start: Position,
        writer: EpisodeWriter | None,
        failure: list[BaseException],
    ) -> None:
        position, phase = start, ""
        try:
            for step in path:
                if self._halted.is_set():
                    return
                if writer and step.phase != phase:
                    writer.phase(step.phase, self._clock.now_ns())
                before, phase = position, step.phase
                if step.target is None:
                    done = self._cnc.dwell(step.seconds)
                else:
                    done, position = self._cnc.move(step.target, step.speed), step.target
                if writer:
                    times = done.sent_ns, done.acknowledged_ns
                    ends = np.array(before, float), np.array(position, float)
                    writer.motion(Command(phase, *ends, step.speed, step.seconds, *times, done.line))
            self._cnc.wait_idle(MARGIN)
        except BaseException as error:  # handed to the watching thread, which raises it
            failure.append(error)

    def lift(self, height: float, speed: float) -> str:
        """After a stop: go straight up to machine height [mm] at ``speed`` [mm/s]; return the result as a sentence."""
        if self._rest is None:
            return f"the indenter was not lifted ({self._why}); free it by hand"
        x, y, z = self._rest
        try:
            if z < height:
                self._cnc.move((x, y, height), speed)
                self._cnc.wait_idle(MARGIN + (height - z) / speed)
        except TacdataError as error:
            return f"the indenter was not lifted: {error.given}"
        return f"the indenter was lifted off the skin, straight up from {z:.3f} to {max(z, height):.3f} mm"
