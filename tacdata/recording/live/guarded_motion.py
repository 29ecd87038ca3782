"""Motion that stops as soon as any stream reports a fault."""

from __future__ import annotations

import threading
from contextlib import suppress

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, MotionController, StandsStill
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.machine_state import MachineState
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.recording.motion.allowed_path import AllowedPath
from tacdata.recording.motion.move_times import Command, report_resolution
from tacdata.recording.motion.press_steps import Position, Step
from tacdata.recording.motion.trapezoid import AxisLimits

WATCH = 0.02
"""Interval at which the motion is watched for faults and Ctrl-C [s of real time]."""
MARGIN = 15.0
"""Time allowed for coming to rest at the end of a path before it counts as hung [s of the host's clock]."""
LIFTS = 3
"""Attempts to lift the tip after a stop [count]."""
LIFT_SPEED = 2.0
"""Greatest speed of a lift [mm/s]."""
LETTING_GO = 10.0
"""Time allowed for a stopped motion's thread to end [s of real time]."""

REASON = 1.0
"""Time in which a stream that stopped the motion gives its reason [s of real time]."""
BY_HAND = "; free it by hand"
LATER = "; leave it, the next start lifts it straight up"
"""Where a machine at rest keeps its position: a tip that is freed by hand loses it."""
ASKS = "; leave it, the next start asks, then lifts it straight up"
"""Where nobody saw the machine come to rest."""
STALL = 3.0
"""Time that this computer may stand still while the guide moves [s of real time]: suspended, or a closed lid."""


class GuardedMotion:
    """Carries out steps in a thread of its own, so that the calling thread can stop them at any moment."""

    def __init__(
        self,
        cnc: MotionController,
        clock: Clock,
        interruption: Interruption | None = None,
        state: MachineState | None = None,
    ) -> None:
        """Drive ``cnc``; nothing moves before `drive`, which looks for signals that the interruption holds back.

        ``state`` receives a mark before each motion; `settle` ends it.
        """
        self._state = state
        self._cnc, self._clock, self._interruption = cnc, clock, interruption or Interruption()
        self._halted = clock.host.event()
        self._rest: Position | None = None  # its place after a stop; None: it runs, or does not obey
        self._why = "nothing was stopped"
        self._stands: Position | None = None  # place of a machine that does not obey, if that is known
        self._path: AllowedPath | None = None
        self._at: Position | None = None  # where the last path ended
        self._lifted, self._clear, self._still = "", False, False
        self._reported: Position | None = None  # latest position reported when the last stop was over
        self._rising: float | None = None  # machine height to which a lift is under way, or was when it broke off

    def off_path(self, status: CncStatus) -> DeviceError | None:
        """Return the fault of a reported position, by the moves that were sent; or None."""
        fault = self._path.off(status) if self._path else None
        if fault and self._path:
            self._path.forget()  # it was noticed; from now on reports say where it comes to rest
        return fault

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
            start: Position of the guide [mm].
            streams: Watched for faults.
            writer: Receives every acknowledged step.

        Raises:
            DeviceError: On a fault, after a feed hold and dropping the queue.
            KeyboardInterrupt: On Ctrl-C, after the same.
        """
        if self._state:
            self._state.moving()
        failure, host = list[BaseException](), self._clock.host
        # Motion has a thread of its own, so that this one watches the streams while a move blocks.
        work = self._clock.host.thread(self._carry_out, "motion", (path, start, writer, failure))
        self._allowed.stand(start, self._clock.now_ns())
        self._at = None
        try:
            work.start()
            looked = host.monotonic()
            while work.is_alive():
                work.join(WATCH)
                # A suspended computer wakes up in mid-move, with reports that are old.
                looked = _look_again(looked, host.monotonic())
                self._interruption.check()
                if streams.fault:
                    break
            end = host.monotonic() + (REASON if self._halted.is_set() else WATCH)
            while (failure or self._halted.is_set()) and streams.fault is None and host.monotonic() < end:
                host.sleep(WATCH / 2)  # a stream that stopped the motion is about to give the reason
            if streams.fault or failure:
                raise streams.fault or failure[0]
            if self._halted.is_set():  # the steps were not carried out
                raise DeviceError("the motion was stopped", "a motion that reaches its end", "start again")
        except BaseException:
            self.stop()
            try:
                self._let_go(work)
            finally:
                self._reported = streams.position
            raise
        self._at = next((step.target for step in reversed(path) if step.target), start)
        return self._at

    def settle(self) -> None:
        """Record where the machine is at rest."""
        if self._state and not self._cnc.position_lost:
            self._state.rest()

    @property
    def _allowed(self) -> AllowedPath:
        if self._path is None:
            cnc = self._cnc
            limits = AxisLimits(np.asarray(cnc.acceleration, float), np.asarray(cnc.max_rate, float))
            self._path = AllowedPath(limits, float(np.linalg.norm(report_resolution(cnc.settings()))))
        return self._path

    def _let_go(self, work: threading.Thread) -> None:
        """After a stop: wait until the motion's thread sends nothing more, then empty the controller's queue."""
        self._rest, self._why, self._lifted = None, "interrupted while it was being stopped", ""
        self._rising = None
        self._clear, self._still, self._stands = False, False, None
        work.join(LETTING_GO)
        if work.is_alive():
            self._why = "the motion's thread does not end"
            return
        self._allowed.forget()
        self._find_rest()

    def _find_rest(self) -> None:
        """Empty the controller's queue, and take its position, or why that is unknown."""
        self._rest = None
        try:
            # A feed hold alone keeps the queue: the next command would first run what was stopped.
            self._rest = self._cnc.abandon()
        except TacdataError as error:
            self._why, self._still = error.given, isinstance(error, StandsStill)
            self._stands = error.at if isinstance(error, StandsStill) else None
        else:
            # A place that cannot be reached in the time since is a damaged report, or a controller that lost its count.
            # A lift from there could go anywhere.
            if why := self._allowed.out_of_reach(self._rest, self._clock.now_ns()):
                self._rest, self._why, self._still = None, why, True
                self._cnc.lose_position(why)
                return
            self._allowed.stand(self._rest, self._clock.now_ns())

    def _carry_out(
        self, path: tuple[Step, ...], start: Position, writer: EpisodeWriter | None, failure: list[BaseException]
    ) -> None:
        position, phase = start, ""
        try:
            for step in path:
                if self._halted.is_set():
                    return
                if writer and step.phase != phase:
                    writer.phase(step.phase, self._clock.now_ns())
                origin, phase = position, step.phase
                if step.target is None:
                    done = self._cnc.dwell(step.seconds)
                    if missed := self._allowed.rested(done.acknowledged_ns, step.seconds):
                        raise missed
                else:
                    # Entered before it is sent, as another thread may read a report of it at once.
                    self._allowed.move(step.target, step.speed, self._clock.now_ns())
                    # Outside of a press a way up names no x and y, so that a wrong report moves nothing sideways.
                    is_rise = not step.phase and step.target[:2] == position[:2] and step.target[2] > position[2]
                    go = self._cnc.rise if is_rise else self._cnc.move
                    done, position = go(step.target, step.speed), step.target
                    self._allowed.taken(done.acknowledged_ns)
                if writer:
                    times = done.sent_ns, done.acknowledged_ns
                    ends = np.array(origin, float), np.array(position, float)
                    writer.motion(Command(phase, *ends, step.speed, step.seconds, *times, done.line))
            # An acknowledged line is only queued.
            self._cnc.wait_idle(MARGIN)
            self._allowed.rested(self._clock.now_ns())
        except BaseException as error:  # handed to the watching thread, which raises it
            failure.append(error)

    def lift(self, height: float, speed: float) -> str:
        """After a stop: go straight up to machine height [mm] at ``speed`` [mm/s]; return the result as a sentence."""
        # This text stays if the lift itself is interrupted.
        self._lifted = f"the indenter was not lifted (interrupted){self._advice}"
        # In one line: a signal before it finds a lift under way, not a tip that still stands where the lift began.
        self._lifted, self._rising = self._lift(height, speed), None
        if self.lifted or self._still:
            with suppress(TacdataError):  # the fault itself must be reported first; the mark of a motion stays
                self.settle()
        return self._lifted

    def _lift(self, height: float, speed: float) -> str:
        if self._rest is None and self._stands and self._stands[2] >= height:  # it parked itself
            return f"the indenter stands clear of the skin, at machine height {self._stands[2]:.3f} mm"
        if self._rest is None:
            return f"the indenter was not lifted ({self._why}){self._advice}"
        begun = self._rest[2]
        # A damaged line ends a lift, not the need for it. Each attempt begins from rest.
        for attempt in range(1, LIFTS + 1):
            try:
                reached = self._rise_to(height, speed)
                break
            except TacdataError as error:
                if not self._came_to_rest() or attempt == LIFTS:
                    return f"the indenter was not lifted all the way: {error.given}{self._advice}"
        self._at, self._clear = reached, True
        if begun >= height:
            return f"the indenter stands clear of the skin, at machine height {begun:.3f} mm"
        again = "" if attempt == 1 else f", at the attempt number {attempt}"
        z, top = self._rest[2], reached[2]
        return f"the indenter was lifted off the skin, straight up from {z:.3f} to {top:.3f} mm{again}"

    def _rise_to(self, height: float, speed: float) -> Position:
        """Rise from rest to ``height`` [mm]; return where it ended by a report.

        It rises slowly: a damaged line is then noticed near the place of rest. One that ends too low is on the path all
        the way, so the end is compared with the wanted height.
        """
        x, y, z = start = self._rest or (np.nan, np.nan, np.inf)
        # Never downwards: a lift that goes down would press.
        if z >= height:
            return start
        self._rising, speed = height, min(speed, LIFT_SPEED)
        self._lifted = f"the indenter was not lifted all the way (interrupted){self._advice}"
        self._allowed.move((x, y, height), speed, self._clock.now_ns())
        self._cnc.rise((x, y, height), speed)
        self._cnc.wait_idle(MARGIN + (height - z) / speed)
        reached = self._cnc.reported or (x, y, height)
        # An answer says that a line was read, not that the digits arrived whole.
        if self._allowed.is_short((x, y, height), reached):
            raise DeviceError(
                f"the lift ended at {_text(reached)} mm, not at {_text((x, y, height))} mm",
                "a lift that ends where it was sent",
                "a line was damaged on its way: check cable and ground, then start again",
            )
        return reached

    def _came_to_rest(self) -> bool:
        """After a lift that failed: stop again; return whether the controller obeys and its place is known."""
        self._cnc.feed_hold()
        self._allowed.forget()
        self._rising = None
        self._find_rest()
        return self._rest is not None

    @property
    def _advice(self) -> str:
        if self._cnc.position_lost:
            return BY_HAND
        return LATER if self._still or self._rest is not None else ASKS

    def go_on(self) -> Position:
        """After a stop and a lift: accept steps again, and return the guide's position [mm].

        Raises:
            DeviceError: If it was not lifted.
        """
        if not self.lifted or self._at is None:
            raise DeviceError("the indenter was not lifted", "a lifted indenter", "free it by hand, then start again")
        self._halted.clear()
        self._lifted, self._rest = "", None
        return self._at

    @property
    def lifted(self) -> bool:
        """Whether the tip was lifted after the last stop."""
        return self._rest is not None and self._rising is None and self._clear

    @property
    def ending(self) -> tuple[str, ...]:
        """Final remarks for a person, a line each: does it move, where is it, was the tip lifted?"""
        if self._path is None:
            if not self._cnc.moved:
                return ("motion: nothing was moved",)
            lost = self._cnc.position_lost
            return (f"motion: the machine moved while homing{f', and {lost}: its position is lost' if lost else ''}",)
        if self._lifted or self._halted.is_set():
            tip = (self._lifted or f"the indenter was not lifted{self._advice}").replace(f" ({self._why})", "")
            for advice in (LATER, ASKS):
                tip = tip.replace(advice, self._advice)  # the position may have been lost since
            if self._still:
                stands = "" if "stands at" in self._why else self._last_seen
                return f"motion: stopped ({self._why}){stands}", f"tip:    {tip}"
            if self._rest is None:
                words = f"motion: NOT KNOWN to have stopped ({self._why}){self._last_seen}"
                return f"{words}; if it moves, press the emergency stop", f"tip:    {tip}"
            if self._rising is not None:
                way = f"straight up from {_text(self._rest)} to z {self._rising:.2f} mm"
                return f"motion: NOT KNOWN to have stopped on its way {way}", f"tip:    {tip}"
            return f"motion: stopped at {_text(self._rest)} mm", f"tip:    {tip}"
        return (f"motion: at rest at {_text(self._at)} mm" if self._at else "motion: NOT KNOWN to have stopped",)

    @property
    def _last_seen(self) -> str:
        return f"; it last reported {_text(self._reported)} mm" if self._reported else ""


def _look_again(looked: float, moment: float) -> float:
    """Return ``instant`` [s]; raise if this computer stood still since it ``looked``."""
    if moment - looked > STALL:
        raise DeviceError(
            f"this computer stood still for {moment - looked:.1f} s while the guide moved (suspended, a closed lid, or "
            "far too busy); what the devices sent meanwhile is partly lost",
            f"at most {STALL:g} s",
            "keep it awake while the guide moves, then start again",
        )
    return moment


def _text(position: Position) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in position) + ")"
