"""The probe of a real rig: guarded motion within the envelope, readings from the board's stream."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any, cast

import numpy as np

from tacdata.devices.device import CncStatus, OwesAnswer, TaxelFrame
from tacdata.errors import DeviceError, FormatError, TacdataError
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.recording.motion.press_steps import Step
from tacdata.registration.probe import Position, Probe, StillReading
from tacdata.rig import Rig
from tacdata.wire.patience import Patience

PATIENCE = 5.0
"""Timeout of the first frames and of a reading [s of real time, and of the rig's clock]."""
LIFT_SPEED = 5.0
"""Speed of the lift after a stall of the controller [mm/s]."""
SIDEWAYS = 0.01
"""A move of less than this in x and y counts as vertical [mm]."""
LOOK = 0.002
"""Interval at which new frames are looked for [s of real time]."""


class _Sink:
    """Receives the streams' data, in place of a recording's writer."""

    failure: Exception | None = None

    def __init__(self) -> None:
        self.begun_ns = 0
        self.frames: list[tuple[int, np.ndarray]] = []

    def taxels(self, frame: TaxelFrame, sample_ns: int, board: str = "") -> None:
        """Keep a frame with its sample time [ns]."""
        self.frames.append((sample_ns, frame.counts))

    def status(self, status: CncStatus) -> None:
        """Ignore a status report."""

    def image(self, *image: Any) -> None:
        """Ignore an image."""

    def cube(self, *pose: Any) -> None:
        """Ignore a pose."""

    def note(self, words: str, level: str) -> None:
        """Ignore a remark."""


class GuardedProbe(Probe):
    """Drives the devices of a rig; made by `guarded_probe`."""

    def __init__(
        self,
        rig: Rig,
        devices: RigDevices,
        streams: RigStreams,
        motion: GuardedMotion,
        height: float,
        interruption: Interruption,
        say: Callable[[str], None] = lambda words: None,
        position: Position | None = None,
    ) -> None:
        """Use open devices and running streams; ``height`` [mm, machine] is a safe height.

        ``position`` is the guide's position [mm, machine]; by default the reported one.
        """
        self._rig, self._devices, self._streams, self._motion = rig, devices, streams, motion
        self._height, self._sink, self._interruption = height, _Sink(), interruption
        self._say, self._retried = say, False
        streams.record_into(cast(Any, self._sink))
        reported = self._begin()
        self._position = position or reported
        self._rested_ns = rig.clock.now_ns()
        self.lowest = self._position[2]
        """Lowest machine height so far [mm]."""
        self.stopped = False
        """Whether a motion was broken off."""

    @property
    def position(self) -> Position:
        """Where the guide was last sent [mm, machine]."""
        return self._position

    def _begin(self) -> Position:
        patience = Patience(PATIENCE, host=self._rig.clock.host)
        while self._streams.position is None or len(self._sink.frames) < 2:
            self._interruption.check()
            if self._streams.fault:
                raise self._streams.fault
            if patience.over():
                raise self._streams.nothing_yet(PATIENCE)
            self._rig.clock.host.sleep(LOOK)
        return self._streams.position

    def go(self, position: Position, speed: float) -> None:
        """Go there through guarded motion; see the base."""
        if not self._rig.envelope.contains(position):
            where = ", ".join(f"{value:.2f}" for value in position)
            raise FormatError(
                f"the registration needs the machine position ({where}) mm",
                f"{self._rig.envelope.min} to {self._rig.envelope.max} mm (the rig's envelope)",
                "correct registration/origin or the envelope in the rig file",
            )
        if np.allclose(position, self._position, atol=1e-9):
            return
        try:
            self._drive(position, speed)
        # One stall, of a busy computer for example, should not cost a registration of five minutes.
        except OwesAnswer as error:
            if not self._lifted_to_try_again(error):
                raise
            self._drive(position, speed)
        self._rested_ns = self._rig.clock.now_ns()
        self.lowest = min(self.lowest, position[2])

    def _drive(self, position: Position, speed: float) -> None:
        try:
            self._position = self._motion.drive(self._way(position, speed), self._position, self._streams, None)
        except BaseException:
            self.stopped = True
            raise

    def _lifted_to_try_again(self, error: OwesAnswer) -> bool:
        """After a controller's first stall: lift the indenter; return whether the way may be tried once more."""
        if self._retried or self._streams.fault or self._devices.cnc.position_lost:
            return False
        self._retried = True
        self._motion.lift(self._height, LIFT_SPEED)
        # A stream may have failed during the lift.
        if not self._motion.lifted or self._streams.fault:
            return False
        self._say(f"{error.given}; the indenter was lifted, and the way is tried once more")
        self._position, self.stopped = self._motion.go_on(), False
        return True

    def _way(self, position: Position, speed: float) -> tuple[Step, ...]:
        """Return the steps there: sideways only at the higher of the two heights, so that nothing is hit."""
        x, y, z = self._position
        if np.hypot(position[0] - x, position[1] - y) < SIDEWAYS or abs(position[2] - z) < SIDEWAYS:
            return (Step("", position, speed),)
        # Down last, or up first.
        corner = (position[0], position[1], z) if position[2] < z else (x, y, position[2])
        return Step("", corner, speed), Step("", position, speed)

    def rise(self, speed: float) -> None:
        """Go straight up to the safe height."""
        self.go(self._rig.envelope.top_of_rise(self._position, self._height), speed)

    def read(self, frames: int) -> StillReading:
        """Collect frames sampled since the guide came to rest; see the base."""
        clock = self._rig.clock
        # Five times as long as a board of 30 Hz needs; a virtual rig's clock may run faster than the host's.
        patience = Patience(PATIENCE + PATIENCE * frames / 30 / clock.rate, host=clock.host)
        while True:
            rows = [counts for sample_ns, counts in list(self._sink.frames) if sample_ns >= self._rested_ns]
            if len(rows) >= frames:
                break
            self._look()
            if patience.over():
                raise DeviceError(
                    f"{len(rows)} of {frames} frames within the time", "a board that keeps its rate", "check the board"
                )
            self._rig.clock.host.sleep(LOOK)
        sample = np.array(rows[:frames])
        # A registration takes thousands of frames, which nobody reads again.
        self._sink.frames.clear()
        spread = sample.std(axis=0, ddof=1) if frames > 1 else np.zeros(sample.shape[1])
        return StillReading(sample.mean(axis=0), spread, frames)

    def wait(self, seconds: float) -> None:
        """Wait on the rig's clock, watching for faults; see the base."""
        until = self._rig.clock.now_ns() + round(seconds * 1e9)
        while self._rig.clock.now_ns() < until:
            self._look()
            self._rig.clock.host.sleep(LOOK)

    def _look(self) -> None:
        """Raise a fault of a guide at rest; one that the controller reports ends the motion first."""
        self._interruption.check()
        if self._streams.fault:
            raise self._streams.fault
        try:
            self._devices.cnc.check()
        except DeviceError:
            self._drive(self._position, LIFT_SPEED)  # raises it, with the guide stopped and ready for a lift
            raise


@contextmanager
def guarded_probe(
    rig: Rig,
    devices: RigDevices,
    height: float,
    speed: float,
    interruption: Interruption | None = None,
    motion: GuardedMotion | None = None,
    say: Callable[[str], None] = lambda words: None,
) -> Iterator[GuardedProbe]:
    """Yield a probe on open devices, lifted to ``height`` [mm, machine] at ``speed`` [mm/s].

    On any fault the motion stops first; then the indenter is lifted straight up. A Ctrl-C held back by ``interruption``
    is noticed within 20 ms. The ``motion``'s `ending` describes the outcome.
    """
    interruption = interruption or Interruption()
    motion = motion or GuardedMotion(devices.cnc, rig.clock, interruption)
    # No image is needed, and a search for tags would slow the readings down.
    without_cameras = replace(devices, cameras={})
    streams = RigStreams(without_cameras, {}, motion.stop, off_path=motion.off_path)
    with (
        streams,
        interruption.kept(),
        probing(rig, devices, streams, motion, height, speed, interruption, say) as probe,
    ):
        yield probe


@contextmanager
def probing(
    rig: Rig,
    devices: RigDevices,
    streams: RigStreams,
    motion: GuardedMotion,
    height: float,
    speed: float,
    interruption: Interruption,
    say: Callable[[str], None] = lambda words: None,
    position: Position | None = None,
) -> Iterator[GuardedProbe]:
    """Yield a probe on running streams, lifted to ``height`` [mm, machine] before and after; see `guarded_probe`."""
    probe = GuardedProbe(rig, devices, streams, motion, height, interruption, say, position)
    try:
        probe.rise(speed)
        yield probe
        probe.rise(speed)
        motion.settle()
    except BaseException:
        _free(probe, motion, streams, height, speed)
        raise
    finally:
        streams.record_into(None)


def _free(probe: GuardedProbe, motion: GuardedMotion, streams: RigStreams, height: float, speed: float) -> None:
    """Lift the indenter after a fault; never raises."""
    if streams.fault is None and not probe.stopped:
        with suppress(TacdataError):
            probe.rise(speed)
            motion.settle()
            return
    if not probe.stopped:  # a fault while the guide stood still: the hold must be released first
        with suppress(TacdataError):
            motion.drive((), probe.position, streams, None)
    motion.lift(height, speed)
