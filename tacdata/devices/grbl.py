"""GRBL 1.1 and grblHAL controllers on a serial port."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, Motion, MotionController
from tacdata.errors import DeviceError, UsageError
from tacdata.wire.grbl_lines import MESSAGE, READY_STATES, SETTING
from tacdata.wire.grbl_link import GrblLink, inches_to_mm
from tacdata.wire.serial_port import open_port

GREETING = 4.0
"""Longest wait for the first sign of life [s, real time]: a boot loader takes 1-2 s of it."""
ANSWER = 5.0
"""Longest wait for the answer to a ``$`` command [s of the clock]."""


class Grbl(MotionController):
    """A GRBL 1.1 or grblHAL controller, driven by the send-response protocol of its documentation.

    Settings in the rig file: ``port``; ``baud`` (115200); ``poll_rate`` (8) queries a second; ``dtr`` (none:
    as the system sets it; false for boards that are held in reset by it); ``home`` (false): run ``$H`` at
    opening if the controller is locked. All moves are given in machine coordinates (G53), so work offsets do
    not matter.
    """

    def __init__(
        self, clock: Clock, port: str, baud: int = 115200, poll_rate: float = 8.0, dtr: bool | None = None,
        home: bool = False,
    ) -> None:  # fmt: skip
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
        self._settings: dict[str, str] = {}

    def describe(self) -> dict[str, Any]:
        """Return what the status reports hold."""
        return {
            "kind": "motion controller", "driver": "grbl", "port": self.port, "baud": self.baud,
            "axes": ["x", "y", "z"],
            "position": {"unit": "mm", "shape": [3], "frame": "machine"}, "feed": {"unit": "mm/min"},
            "status_rate": {"nominal": self.poll_rate, "unit": "Hz"},
        }  # fmt: skip

    def open(self) -> None:
        """Open the port, wait for a sign of life, read the settings, begin to poll.

        Raises:
            DeviceError: If the port is missing or busy, nothing answers, or the machine is moving or locked.
        """
        self._link = GrblLink(
            open_port(self.port, self.baud, "motion controller", 0.05, self.dtr), self.clock, self.poll_rate
        )
        try:
            self._link.start()
            reset = self._greet(self._link)
            state = self._make_ready(self._link)
            self._settings = self._read_settings(self._link)
            self._settings["reset_at_opening"] = "yes" if reset else "no"
            self._settings["state_at_opening"] = state
            self._link.unit = inches_to_mm(self._settings.get("$13") == "1")
            self._link.take_statuses()
            self._link.poll()
            self._limits("$12", 1.0)
            self._limits("$11", 60.0)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the port; a machine still in motion gets a feed hold first."""
        link, self._link = self._link, None
        if link is None:
            return
        if link.last and link.last.state.split(":")[0] in ("Run", "Jog") and not link.fault:
            try:
                link.realtime(b"!")
            except DeviceError:
                pass
        link.stop()

    def settings(self) -> dict[str, str]:
        """Return ``banner``, the ``$n`` settings, and ``$G``, ``$#``, ``$I`` by their tags."""
        return dict(self._settings)

    @property
    def acceleration(self) -> np.ndarray:
        """``$120``-``$122`` [mm/s^2], shape (3,)."""
        return self._limits("$12", 1.0)

    @property
    def max_rate(self) -> np.ndarray:
        """``$110``-``$112`` [mm/s], shape (3,)."""
        return self._limits("$11", 60.0)

    def move(self, position: tuple[float, float, float], speed: float) -> Motion:
        """Queue a straight move; every modal word stands in the line, so that no earlier state bends it."""
        if not (np.all(np.isfinite(position)) and np.isfinite(speed) and speed > 0):
            raise UsageError(
                f"a move to {position} mm at {speed} mm/s",
                "finite positions and a speed above 0",
                "correct the plan",
            )
        x, y, z = position
        return self._send(f"G53G90G94G21G1X{x:.4f}Y{y:.4f}Z{z:.4f}F{60 * speed:.3f}")

    def dwell(self, seconds: float) -> Motion:
        """Pause [s]; GRBL answers only when the planner is empty and the pause is over."""
        return self._send(f"G4P{max(seconds, 0.0):.3f}")

    def wait_idle(self, timeout: float) -> None:
        """Return when the planner is empty (``G4 P0.01`` answered) and a fresh report says Idle."""
        link = self._opened()
        link.command("G4P0.01", timeout)
        while link.fresh_status(timeout).state != "Idle":
            link.wait(
                lambda: link.last is not None and link.last.state == "Idle", timeout, "the machine to be idle"
            )

    def statuses(self) -> list[CncStatus]:
        """Return the reports received since the last call; what came before a fault is still handed out."""
        return self._opened().take_statuses()

    def check(self) -> None:
        """Raise what has gone wrong since the last call, if anything.

        Raises:
            DeviceError: On alarm, reset, a broken line or silence.
        """
        self._opened().check()

    def feed_hold(self) -> None:
        """Send ``!``; does nothing on a closed controller."""
        try:
            if self._link is not None:
                self._link.realtime(b"!")
        except DeviceError:
            pass  # the broken line is a fault that every other call raises; a signal handler must not

    def resume(self) -> None:
        """Send ``~``."""
        self._opened().realtime(b"~")

    def abandon(self) -> None:
        """Wait until the hold is complete, then soft-reset: the planner is emptied and the position kept.

        Raises:
            DeviceError: If the machine does not come to rest, or does not come back from the reset.
        """
        link = self._opened()
        link.check()
        status = link.fresh_status(ANSWER)
        if status.state.split(":")[0] in ("Run", "Jog"):
            link.realtime(b"!")
        while (status := link.fresh_status(ANSWER)).state in ("Hold:1", "Run", "Jog"):
            link.check()
        link.soft_reset(ANSWER)
        if link.fresh_status(ANSWER).state.startswith("Alarm"):
            link.command("$X", ANSWER)

    def home(self, timeout: float = 120.0) -> None:
        """Run the homing cycle (``$H``), which moves every axis to its switch [timeout in s of the clock].

        Raises:
            DeviceError: If homing is switched off or fails.
        """
        link = self._opened()
        link.watch(False)  # GRBL answers nothing while homing
        try:
            link.command("$H", timeout)
        finally:
            link.watch(True)

    def _opened(self) -> GrblLink:
        if self._link is None:
            raise DeviceError(f"the controller on {self.port} is not open", "an open one", "open it first")
        return self._link

    def _send(self, line: str) -> Motion:
        _, sent_ns, acknowledged_ns = self._opened().command(line, None)
        return Motion(line, sent_ns, acknowledged_ns)

    def _greet(self, link: GrblLink) -> bool:
        """Wait for a welcome or an answer to ``?``; return True if there was a welcome, that is, a reset."""
        for _ in range(int(GREETING / 0.25)):
            if link.hear(0.25):
                link.check()
                return bool(link.welcome)
            link.ask()
        raise self._silent(link)

    def _silent(self, link: GrblLink) -> DeviceError:
        seen = bytes(link.seen)
        return DeviceError(
            f"nothing on {self.port} at {self.baud} baud speaks GRBL: "
            + (
                f"it sent {len(seen)} bytes or more, beginning {seen[:24].hex(' ')}"
                if seen
                else "it sent no byte"
            ),
            "a GRBL 1.1 or grblHAL controller that says its welcome or answers ?",
            "check the baud rate (GRBL: 115200) and that this is the controller's port"
            if seen
            else "check power, cable and port; some boards need dtr: false under cnc",
        )

    def _make_ready(self, link: GrblLink) -> str:
        """Bring the controller to Idle without moving it, or say why it cannot be; return the state found."""
        state = link.fresh_status(ANSWER).state
        if state == "Hold:0":
            link.soft_reset(ANSWER)
        if state.split(":")[0] == "Alarm" and self.home_first:
            self.home()
        now = link.fresh_status(ANSWER).state
        if now.split(":")[0] not in READY_STATES:
            raise DeviceError(
                f"the controller on {self.port} is in state {now}",
                "Idle",
                "let it finish or stop it, then try again",
            )
        if now.split(":")[0] == "Alarm":
            raise DeviceError(
                f"the controller on {self.port} is locked (state {now}): its position is not known",
                "a homed controller in state Idle",
                "home it ($H), or set home: true under cnc in the rig file (every axis moves at opening)",
            )
        return state

    def _read_settings(self, link: GrblLink) -> dict[str, str]:
        found = {"banner": link.welcome}
        for line in ("$I", "$$", "$G", "$#"):
            for pushed in link.command(line, ANSWER)[0]:
                if setting := SETTING.match(pushed):
                    found[setting[1]] = setting[2]
                elif message := MESSAGE.match(pushed):
                    found[message[1]] = message[2]
        if not found["banner"]:
            found["banner"] = (
                f"none, the board was not reset by opening; $I says {found.get('VER', 'nothing')}"
            )
        return found

    def _limits(self, prefix: str, divisor: float) -> np.ndarray:
        try:
            values = np.array([float(self._settings[f"{prefix}{axis}"]) for axis in range(3)]) / divisor
        except (KeyError, ValueError):
            values = np.zeros(3)
        if not np.all(values > 0):
            raise DeviceError(
                f"the controller on {self.port} reports no usable {prefix}0 to {prefix}2",
                "a positive rate and acceleration for each axis",
                "open it first; if it is open, correct these settings in the controller",
            )
        return values
