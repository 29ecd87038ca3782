"""Questions about a position that may be lost; a person's yes to the question ends them, --yes does not."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from tacdata.devices.device import MotionController
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.live.machine_state import UNKNOWN, MachineState
from tacdata.recording.live.rig_devices import RigDevices

Ask = Callable[[str], bool]
"""Puts a question to a person; True only for a yes that was given to this very question."""
OPTION = "--confirm-position"
"""Option of a verb that answers one question in advance, by the code that its refusal states."""


class PositionGuard:
    """Compares a machine's last position with its controller's report, and asks where they differ.

    Example:
        ``guard = PositionGuard(state, cnc, ask); guard.before_homing(False); ...open...; guard.require_known(-35.0)``
    """

    def __init__(self, state: MachineState, cnc: MotionController, ask: Ask, confirmed: str = "") -> None:
        """Ask by ``ask``, unless ``confirmed`` is the code of the question."""
        self._state, self._cnc, self._ask, self._confirmed = state, cnc, ask, confirmed.strip().lower()

    def before_homing(self, resumed: bool) -> None:
        """Ask whether the tip is free before the controller homes at opening, unless it was merely switched on.

        Args:
            resumed: Whether earlier recordings rest on the same machine zero.
        """

        def require_free() -> None:
            if why := self._state.why_lost or self._cnc.alarm or ("the controller is locked" if resumed else ""):
                self._require_free(why)

        self._cnc.before_homing = require_free

    @contextmanager
    def opened(self, devices: RigDevices) -> Iterator[RigDevices]:
        """A context that opens the devices, and records at its end where the machine is, or why that is unknown."""
        with devices.opened():
            try:
                yield devices
            finally:
                with suppress(TacdataError):  # a fault that ends the context must be reported first
                    self._state.close()

    def loss(self) -> str:
        """After the devices were closed: record a loss; return why the position is unknown, empty if it is known."""
        if why := self._cnc.position_lost:
            with suppress(TacdataError):  # a fault that ended the session must be reported first
                self._state.lose(why)
        return why or self._state.loss

    def doubt(self, resumed: bool) -> str:
        """Return why the position of the opened controller is not known, in words; empty if it is."""
        if self._cnc.settings().get("homed_at_opening") == "yes":
            return ""
        # A Grbl never states whether it was homed: $X unlocks it without.
        homed = self._cnc.settings().get("homed_before") == "yes"
        unmet = UNKNOWN if (resumed or not homed) and not self._state.is_known else ""
        return self._state.why_lost or self._cnc.position_lost or self._state.difference or unmet

    def require_known(self, height: float, resumed: bool = False) -> None:
        """Ask whether a position that was lost was found again.

        Args:
            height: Where the first move ends, straight up [mm, machine].
            resumed: Whether earlier recordings rest on the same machine zero.

        Raises:
            DeviceError: If nobody confirms. Nothing has moved.
        """
        why = self.doubt(resumed)
        code = self._code("known", why) if why else ""
        since = "it was switched on" if why == UNKNOWN else "then"
        question = (
            f"THE POSITION IS NOT KNOWN: {why}.\n"
            f"Has the machine been homed, or its zero found again by a touch-off, since {since}? And is the way "
            f"straight up free, to machine height {height:.2f} mm? [y/N] "
        )
        if why and not self._agreed(question, code):
            raise DeviceError(
                f"the position is not known: {why}",
                "a machine that was homed or touched off since, and a free way straight up",
                "free the tip by hand, home the machine or set its zero again, then start again and say so when asked "
                f"(--yes does not; without a terminal: {OPTION} {code})",
            )
        self._cnc.trust_position()
        self._state.find()

    def _require_free(self, why: str) -> None:
        code = self._code("free", why)
        question = (
            f"THE POSITION WAS LOST: {why}.\n"
            f"The machine is about to home: every axis moves. Is the tip out of the skin, and the way straight up "
            f"free? [y/N] "
        )
        if not self._agreed(question, code):
            raise DeviceError(
                f"the machine was not homed: {why}, and nobody said that the tip is free",
                "a tip that is out of the skin, with a free way straight up",
                "free the tip by hand, then start again and say so when asked "
                f"(--yes does not; without a terminal: {OPTION} {code})",
            )

    def _agreed(self, question: str, code: str) -> bool:
        return self._confirmed == code or self._ask(question)

    def _code(self, question: str, why: str) -> str:
        """Record the loss; return the code of this question about it, which answers no question about a later one."""
        if not self._state.why_lost:
            self._state.lose(why)
        text = f"{question} {self._state.lost_since} {why}"
        return hashlib.sha256(text.encode()).hexdigest()[:6]
