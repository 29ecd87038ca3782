"""GRBL 1.1 and grblHAL controllers on a serial port."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, Motion, MotionController, StandsStill
from tacdata.errors import DeviceError, UsageError
from tacdata.wire.grbl import codes
from tacdata.wire.grbl.lines import OPENED_AGAIN
from tacdata.wire.grbl.link import GrblLink
from tacdata.wire.grbl.opening import ANSWER, ask_all, clear, greet, locked, reset, straighten, unblock, unproved
from tacdata.wire.grbl.owed import Owed
from tacdata.wire.grbl.rest import come_to_rest, in_motion, in_words
from tacdata.wire.grbl.settings import GrblSettings
from tacdata.wire.grbl.silence import READ
from tacdata.wire.serial_port import open_port

HOMING = 600.0
"""Longest homing cycle [s of the clock]: 1.5 times the travel of two slow cycles."""
LONGEST_LINE = 80
"""Longest line that is sent, with its end [bytes]."""
LATE = (1.5, 15.0)
"""Motion counts as a fault when it takes longer than this many times its expected duration, plus this time [s of the
clock].
"""


class Grbl(MotionController):
    """A GRBL 1.1 or grblHAL controller, driven by the send-response protocol of its documentation.

    All moves are in machine coordinates (G53), so work offsets do not matter. Settings in the rig file:

    - ``port``, ``baud`` (115200);
    - ``poll_rate`` (8): status queries per second;
    - ``dtr``: state of the DTR line (default: as the system sets it; false for boards that it holds in reset);
    - ``home`` (false): run ``$H`` at opening if the controller is locked.
    """

    def __init__(
        self,
        clock: Clock,
        port: str,
        baud: int = 115200,
        poll_rate: float = 8.0,
        dtr: bool | None = None,
        home: bool = False,
    ) -> None:
        """Keep the settings; see the class.

        Raises:
            UsageError: If ``poll_rate`` is outside 1 to 10 Hz.
        """
        super().__init__(clock)
        if not 1 <= poll_rate <= 10:
            raise UsageError(
                f"poll_rate {poll_rate:g} Hz",
                "1 to 10 Hz (GRBL's documentation advises 5)",
                "correct poll_rate under cnc",
            )
        self.port, self.baud, self.poll_rate, self.dtr, self.home_first = port, baud, poll_rate, dtr, home
        self._link: GrblLink | None = None
        self._answers = GrblSettings({})
        self._found: dict[str, str] = {}
        self._cautions: tuple[str, ...] = ()
        self._lost, self._moved = "", False
        self._reported: tuple[float, float, float] | None = None
        self._target: np.ndarray | None = None  # where the queued motion ends [mm]
        self._held_ns = clock.now_ns()
        self._ends_ns = 0  # when it has ended at the latest

    def describe(self) -> dict[str, Any]:
        """Return the contents of the status reports."""
        return {
            "kind": "motion controller",
            "driver": "grbl",
            "port": self.port,
            "baud": self.baud,
            "axes": ["x", "y", "z"],
            "position": {"unit": "mm", "shape": [3], "frame": "machine"},
            "feed": {"unit": "mm/min"},
            "status_rate": {"nominal": self.poll_rate, "unit": "Hz"},
        }

    def open(self) -> None:
        """Open the port, wait for a sign of life, read the settings, begin to poll.

        Raises:
            DeviceError: If the port is missing or busy, nothing answers, or the machine is moving or locked.
        """
        port = open_port(self.port, self.baud, "motion controller", READ, self.dtr)
        link = self._link = GrblLink(port, self.clock, self.poll_rate)
        try:
            link.start()
            greet(link, self.baud)
            state = self._make_ready(link)
            ask_all(link, self._answers)
            is_locked = link.fresh_status(ANSWER).state.split(":")[0] == "Alarm"
            if is_locked:
                if not self.home_first:
                    raise locked(link, self._answers)
                self.before_homing()
                unblock(link)
                self.home()
                self._read(link)
            self._cautions = straighten(link)
            self._remember_opening(link, state, is_locked)
            link.take_statuses()
            link.poll()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the port; a machine in motion gets a feed hold first, a homing one a reset."""
        link, self._link = self._link, None
        if link is None:
            return
        with suppress(DeviceError):
            if link.homing:
                link.lost = link.lost or "homing was broken off"
                link.realtime(b"\x18")  # homing heeds nothing else
            elif not link.fault and (not link.at_rest if link.polled else in_motion(link)):
                link.realtime(b"!")
        link.stop()
        self._lost = link.lost or self._lost
        if link.last is not None:
            x, y, z = link.last.position.tolist()
            self._reported = (x, y, z)

    def settings(self) -> dict[str, str]:
        """Return ``banner``, the ``$n`` settings, ``$G``, ``$#``, ``$I`` by their tags, and how lines are checked."""
        echoes = self._link is not None and self._link.echoes
        check = {"line_check": "echo"} if echoes else {}
        return {**self._found, **self._answers.answers, **check}

    @property
    def cautions(self) -> tuple[str, ...]:
        """Remarks before the first move."""
        lost = (f"{self._lost}: touch off before moving",) if self._lost and self._link is not None else ()
        return (*lost, *self._answers.cautions, *self._cautions)

    @property
    def position_lost(self) -> str:
        """Reason for an unknown position, as a sentence; empty while it is known."""
        return (self._link.lost if self._link is not None else "") or self._lost

    @property
    def alarm(self) -> str:
        """Reason of its lock, as a sentence. Empty if it was merely switched on."""
        link = self._link
        if link is None or link.last is None or not link.last.state.startswith("Alarm"):
            return ""
        if link.alarm not in (None, codes.HOMING_REQUIRED):
            return codes.alarm_in_words(link.alarm)
        position = link.last.position
        was_on = f"the controller is locked and says {in_words(position)} mm: it was not just switched on"
        return was_on if np.any(position) else ""

    @property
    def unreadable(self) -> str:
        """The latest report if it could not be read, else nothing."""
        return self._link.silence.unread if self._link is not None else ""

    @property
    def late(self) -> float:
        """Lateness in reading the controller's bytes [s, real time]."""
        return self._link.silence.late if self._link is not None else 0.0

    @property
    def damaged_reports(self) -> int:
        """Status reports that could not be read since the port was opened [count]."""
        return self._link.statuses.damaged if self._link is not None else 0

    def lose_position(self, why: str) -> None:
        """Take that the position is unknown, and why, in words."""
        self._lost = self._lost or why

    def trust_position(self) -> None:
        """Take that a position that was lost before or at opening is known again."""
        self._lost = ""

    @property
    def reported(self) -> tuple[float, float, float] | None:
        """Machine position of the latest report [mm]; kept after `close`."""
        if self._link is not None and self._link.last is not None:
            x, y, z = self._link.last.position.tolist()
            self._reported = (x, y, z)
        return self._reported

    @property
    def moved(self) -> bool:
        """Whether a move or a homing cycle was sent since creation."""
        return self._moved

    @property
    def travel(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Machine box of the soft limits [mm], shapes (3,) and (3,); None if they are off."""
        return self._answers.travel

    @property
    def acceleration(self) -> np.ndarray:
        """``$120``-``$122`` [mm/s^2], shape (3,)."""
        return self._answers.limits("$12", 1.0, self.port)

    @property
    def max_rate(self) -> np.ndarray:
        """``$110``-``$112`` [mm/s], shape (3,)."""
        return self._answers.limits("$11", 60.0, self.port)

    def move(self, position: tuple[float, float, float], speed: float) -> Motion:
        """Queue a straight move; the line states every modal word, so that no earlier state changes it."""
        if not (np.all(np.isfinite(position)) and np.isfinite(speed) and speed > 0):
            raise UsageError(
                f"a move to {position} mm at {speed} mm/s", "finite positions and a speed above 0", "correct the plan"
            )
        x, y, z = position
        # G53: machine coordinates; G90: absolute; G94: feed in mm/min; G21: mm; G1: a straight move.
        return self._go(f"G53G90G94G21G1X{x:.4f}Y{y:.4f}Z{z:.4f}F{60 * speed:.3f}", np.array(position), speed)

    def rise(self, position: tuple[float, float, float], speed: float) -> Motion:
        """Queue a move straight up; the line states no x and y, so a wrong report of them moves nothing sideways."""
        return self._go(f"G53G90G94G21G1Z{position[2]:.4f}F{60 * speed:.3f}", np.array(position), speed)

    def dwell(self, seconds: float) -> Motion:
        """Pause [s]; GRBL answers only when the planner is empty and the pause is over."""
        self._queue(max(seconds, 0.0))
        return self._send(f"G4P{max(seconds, 0.0):.3f}", self._remaining)

    def wait_idle(self, timeout: float) -> None:
        """Return when the planner is empty (``G4 P0.01`` answered) and a fresh report is Idle."""
        link = self._opened()
        link.command("G4P0.01", timeout, min(self._remaining, timeout))
        while link.fresh_status(timeout).state != "Idle":
            idle = Owed("the machine to be idle", timeout)
            link.wait(lambda: link.last is not None and link.last.state == "Idle", idle)

    def statuses(self) -> list[CncStatus]:
        """Return the reports since the last call; those before a fault too."""
        return self._opened().take_statuses()

    def check(self) -> None:
        """Raise the error that occurred since the last call, if any.

        Raises:
            DeviceError: On alarm, reset, a broken line or silence, a hold or an open door.
        """
        self._opened().check()

    def feed_hold(self) -> None:
        """Send ``!``; no line goes out until `resume` or `abandon`. Does nothing on a closed controller."""
        # A broken line is a fault that every other call raises; a signal handler must not raise.
        with suppress(DeviceError):
            if self._link is not None:
                self._held_ns = self.clock.now_ns()
                self._link.hold()

    def resume(self) -> None:
        """Send ``~``."""
        link = self._opened()
        link.rearm()
        # The hold delays the end of the queued motion by its own duration.
        self._ends_ns += self.clock.now_ns() - self._held_ns
        link.realtime(b"~")

    def abandon(self) -> tuple[float, float, float]:
        """Wait until the hold is complete, then soft-reset: the planner is emptied and the position kept.

        Returns:
            Position of the machine then [mm].

        Raises:
            DeviceError: If the machine does not come to rest, or does not come back from the reset.
        """
        link = self._opened()
        self._target, self._ends_ns = None, 0
        if link.halted and link.fault:
            raise StandsStill(link.fault.given, link.fault.allowed, link.fault.remedy)
        status = come_to_rest(link)
        stands, (x, y, z) = f"stands at {in_words(status.position)} mm", status.position.tolist()
        if link.pendant:
            raise StandsStill(
                f"a pendant has control of the machine, which {stands}",
                "one master",
                "give control back at the pendant and look where the tip stands",
                (x, y, z),
            )
        if status.state.startswith("Door") and status.state not in OPENED_AGAIN:
            raise StandsStill(
                f"the safety door is open; the machine {stands}",
                "a closed door",
                "close it; the next start lifts the tip first",
                (x, y, z),
            )
        try:
            reset(link)
            link.rearm()
            link.command("", ANSWER)  # after refusing a line, grblHAL refuses every line until an empty one
            straighten(link)
            x, y, z = link.fresh_status(ANSWER).position.tolist()
        except DeviceError as error:  # it was at rest, and nothing that moves was sent since
            stood = "" if link.halted else f"; the machine {stands}"
            raise StandsStill(f"{error.given}{stood}", error.allowed, error.remedy) from None
        return x, y, z

    def home(self, timeout: float = HOMING) -> None:
        """Run the homing cycle (``$H``), which moves every axis to its switch [timeout in s of the clock].

        Raises:
            DeviceError: If homing is switched off or fails.
        """
        link = self._opened()
        link.homing = self._moved = True  # Grbl answers nothing while homing
        try:
            link.command("$H", timeout)
            link.lost = self._lost = ""
        finally:
            link.homing = link.waiting  # a timed-out homing still moves

    def _opened(self) -> GrblLink:
        if self._link is None:
            raise DeviceError(f"the controller on {self.port} is not open", "an open one", "open it first")
        return self._link

    def _go(self, line: str, target: np.ndarray, speed: float) -> Motion:
        before = self._remaining  # a move is answered before it begins: who stands idle has not received it
        self._queue(self._duration(target, speed))
        self._target, self._moved = target, True
        return self._send(line, before)

    def _send(self, line: str, before: float) -> Motion:
        _, sent_ns, acknowledged_ns = self._opened().command(line, LATE[0] * self._remaining + LATE[1], before)
        return Motion(line, sent_ns, acknowledged_ns)

    @property
    def _remaining(self) -> float:
        """Longest time that the queued motion and pauses may still take [s of the clock]."""
        return max(self._ends_ns - self.clock.now_ns(), 0) * 1e-9

    def _queue(self, seconds: float) -> None:
        self._ends_ns = max(self._ends_ns, self.clock.now_ns()) + round(seconds * 1e9)

    def _duration(self, position: np.ndarray, speed: float) -> float:
        """Return the longest duration of a move from where the queued ones end [s], within the axis limits."""
        last = self._opened().last
        start = self._target if self._target is not None else last.position if last else position
        length = float(np.linalg.norm(position - start))
        slowest = min(speed, float(self.max_rate.min()))  # an upper bound: a diagonal may be faster
        return length / slowest + slowest / float(self.acceleration.min()) if length else 0.0

    def _make_ready(self, link: GrblLink) -> str:
        """End a standing hold, read the settings, and return the state that was found."""
        resets = link.resets
        try:
            state = clear(link)
            self._read(link)
        except DeviceError:
            if link.resets == resets:
                raise
            # Grbl with a fresh memory answers ? before its welcome and loses bytes that are sent meanwhile.
            state = clear(link)
            self._read(link)
        return state

    def _read(self, link: GrblLink) -> None:
        """Read the controller's settings and adapt the link to them."""
        self._answers = answers = GrblSettings.read(link, ANSWER)
        link.statuses.unit, link.statuses.automatic = answers.unit, answers.reports_by_itself
        if answers.rx_bytes and answers.rx_bytes < LONGEST_LINE:
            raise DeviceError(
                f"the controller on {self.port} states a receive buffer of {answers.rx_bytes} bytes",
                f"at least {LONGEST_LINE} bytes: a line of motion must fit in",
                "see its $I in a terminal; use a firmware with the usual 128 bytes",
            )
        link.rx_bytes = answers.rx_bytes or link.rx_bytes
        link.statuses.place(answers.work_offset)
        answers.refuse_moves_at_start(self.port)
        answers.limits("$12", 1.0, self.port)
        answers.limits("$11", 60.0, self.port)

    def _remember_opening(self, link: GrblLink, state: str, homed: bool) -> None:
        """Keep the identified board, and why its position cannot be trusted."""
        position = link.last.position if link.last is not None else np.full(3, np.nan)
        was_homed = link.statuses.homed if self._answers.homing else False  # None: a Grbl is locked until it was
        version = self._answers.answers.get("VER", "nothing")
        self._found = {
            "banner": link.welcome or f"none, the board was not reset by opening; $I says {version}",
            "reset_at_opening": "yes" if link.resets else "no",
            "state_at_opening": state,
            "homed_at_opening": "yes" if homed else "no",
            "homed_before": {True: "yes", False: "no", None: "unknown"}[was_homed],
            # Adding 0.0 turns -0.0 into 0.0, which is printed without a sign.
            "position_at_opening": ",".join(f"{value:.3f}" for value in position + 0.0),
        }
        if not homed:
            self._lost = unproved(link, self._answers) or self._lost
