"""A position that was lost stays lost until a person says that it was found again; --yes does not say so."""

from __future__ import annotations

from collections.abc import Callable

from tacdata.devices.device import MotionController
from tacdata.errors import DeviceError

Ask = Callable[[str], bool]
"""Puts a question to a person; True only for a yes that was given to this very question."""


def why_lost(cnc: MotionController, remembered: str = "", resumed: bool = False) -> str:
    """Return why the position of an opened controller is not known, in words; empty if it is.

    Args:
        cnc: The controller.
        remembered: Why a session lost it, if it did.
        resumed: Whether earlier recordings rest on the same machine zero.
    """
    said = cnc.settings()
    if said.get("homed_at_opening") == "yes":
        return ""
    at_zero = said.get("position_at_opening") == "0.000,0.000,0.000" and said.get("$22") == "0"
    if at_zero and resumed and not (remembered or cnc.position_lost):
        return "the controller says (0, 0, 0) mm, as one does that has just been switched on"
    return remembered or cnc.position_lost


def guard_homing(cnc: MotionController, ask: Ask, remembered: str = "", resumed: bool = False) -> None:
    """Ask whether the tip is free before a controller homes at opening.

    Nobody asks if it was merely switched on.
    """

    def before_homing() -> None:
        why = remembered or cnc.alarm
        if why or resumed:
            require_free(why, ask)

    cnc.before_homing = before_homing


def require_free(why: str, ask: Ask) -> None:
    """Ask whether the tip is free, before a locked controller homes: a tip in the skin would be dragged.

    Args:
        why: Why the position was lost, in words; empty if only the controller says so.
        ask: Puts the question.

    Raises:
        DeviceError: If nobody says yes.
    """
    why = why or "the controller is locked"
    question = (
        f"THE POSITION WAS LOST: {why}.\n"
        f"The machine is about to home: every axis moves. Is the tip out of the skin, and the way straight up free? "
        f"[y/N] "
    )
    if not ask(question):
        raise DeviceError(
            f"the machine was not homed: {why}, and nobody said that the tip is free",
            "a tip that is out of the skin, with a free way straight up",
            "free the tip by hand, then start again and say so when asked (--yes does not)",
        )


def require_found(why: str, height: float, ask: Ask) -> None:
    """Ask whether a position that was lost was found again.

    Args:
        why: Why it was lost, in words; with an empty one nothing is asked.
        height: Where the first move ends, straight up [mm, machine].
        ask: Puts the question.

    Raises:
        DeviceError: If nobody says yes.
    """
    question = (
        f"THE POSITION WAS LOST: {why}.\n"
        f"Has the machine been homed, or its zero found again by a touch-off, since then? And is the way straight up "
        f"free, to machine height {height:.2f} mm? [y/N] "
    )
    if why and not ask(question):
        raise DeviceError(
            f"the position is not known: {why}",
            "a machine that was homed or touched off since, and a free way straight up",
            "free the tip by hand, home the machine or set its zero again, then start again and say so when asked "
            "(--yes does not)",
        )
