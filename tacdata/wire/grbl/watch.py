"""Reports unexpected states of the controller: holds, doors, alarms, overrides."""

from __future__ import annotations

from tacdata.wire.grbl import codes
from tacdata.wire.grbl.lines import StatusReport

Words = tuple[str, str, str]
"""Given, allowed, remedy, as in `tacdata.errors`."""

WELCOME_IN_MID_STREAM: Words = (
    "the controller was reset in mid-stream (it said {!r}); its position is lost",
    "one welcome, when the port is opened",
    "check its power supply and cable (a brown-out does this); home or touch off again",
)
AGAIN = "start again; a session goes on with --resume"
RESUME = f"see why, put it right, then {AGAIN}"
UNASKED = {
    "Hold": ("someone held the motion (a button, or another program)", "no hold", RESUME),
    "Door": ("the safety door was opened", "a closed door", f"close it, then {AGAIN}"),
    "Jog": ("someone jogs the machine", "one master", "leave the machine alone while it records"),
    "Home": ("someone homes the machine", "one master", "leave the machine alone while it records"),
    "Check": ("the controller is in check mode and moves nothing", "Idle or Run", "switch it off ($C)"),
    "Sleep": ("the controller fell asleep and its motors are off", "a machine that is awake", "reset and home it"),
    "Tool": ("the controller waits for a tool change", "no tool change", RESUME),
}
"""State -> text; none of these follows from what a recording sends."""
PENDANT: Words = (
    "a pendant has taken control of the machine (MPG:1): lines from here are ignored",
    "one master",
    f"give control back at the pendant, see where the tip stands, then {AGAIN}",
)
SCALED: Words = (
    "the controller scales its axes (G51): every move goes elsewhere than commanded",
    "no scaling",
    "switch it off (G50) in a terminal; opening the controller does it too",
)
LOST = ("Sleep",)
"""States after which the position is unknown."""


def what_is_wrong(report: StatusReport, held: bool, homing: bool) -> tuple[Words | None, bool]:
    """Return what is wrong by a report, or None, and whether that is permanent.

    Args:
        report: A report of a machine that was opened and made ready.
        held: Whether we sent the hold.
        homing: Whether we started the homing.
    """
    state, _, substate = report.state.partition(":")
    if state == "Alarm":
        why = f": {codes.alarm_in_words(int(substate))}" if substate else ""
        words = (
            f"the controller is locked (state {report.state}{why})",
            "a machine without an alarm",
            "free it by hand if need be, then home or unlock it and record again",
        )
        return words, True
    # A machine that still brakes (Hold:1) may be about to send an alarm with the reason.
    ours = (state == "Hold" and (held or substate != "0")) or (state == "Home" and homing)
    if state in UNASKED and not ours:
        return UNASKED[state], state in LOST
    if report.pendant:
        return PENDANT, False
    if report.scaled:
        return SCALED, False
    if report.feed_override is not None and report.feed_override != 100:
        words = (
            f"the feed override stands at {report.feed_override:g} %: moves do not run as commanded",
            "100 %",
            "leave the override alone while it records; opening the controller sets it back",
        )
        return words, False
    return None, False
