"""Reports unexpected states of the controller: holds, doors, alarms, overrides."""

from __future__ import annotations

from tacdata.wire.grbl import codes
from tacdata.wire.grbl.lines import StatusReport

Words = tuple[str, str, str]
"""Given, allowed, remedy, as in `tacdata.errors`."""

WELCOME_IN_MID_STREAM: Words = (
    "the controller was reset in mid-stream (it said {!r}); its position is lost",
    "one welcome, when the port is opened",
    "check its power supply and cable (a brown-out does this), and that no other program uses its port (one can reset "
    "it); home or touch off again",
)
AGAIN = "start again"
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
"""State -> text; none of these follows from a recording's own lines."""
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
KNOWN = {"Idle", "Run", "Dwell", "Alarm", *UNASKED}
"""States that Grbl, grblHAL and FluidNC have, and GRBL-Advanced (``Dwell``, in a pause)."""


def stopped_by(number: int | None, line: str) -> Words:
    """Return the error for an alarm in motion."""
    is_kept = number in codes.POSITION_KEPT
    return (
        f"the controller stopped with {codes.alarm_in_words(number) if number else line}",
        "motion without an alarm",
        codes.UNLOCK if is_kept else "free the machine by hand if need be, then home it and start again",
    )


def what_is_wrong(
    report: StatusReport, is_held: bool, homing: bool, again: bool = False, still: bool = False
) -> tuple[Words | None, bool]:
    """Return the fault that a report shows, or None, and whether that is permanent.

    Args:
        report: A report of a machine that was opened and made ready.
        is_held: Whether we sent the hold.
        homing: Whether we started the homing.
        again: Whether the report before named the same state; one that nobody knows may be damaged.
        still: Whether it named the same state and place.
    """
    state, _, substate = report.state.partition(":")
    if state == "Alarm":
        why = codes.alarm_in_words(int(substate)) if substate else f"state {report.state}"
        words = (
            f"the controller is locked ({why})",
            "a machine without an alarm",
            "free it by hand if need be, then home or unlock it and record again",
        )
        return words, True
    # A machine that still brakes (Hold:1) may be about to send an alarm with the reason.
    ours = (state == "Hold" and (is_held or (substate == "1" and not still))) or (state == "Home" and homing)
    if state in UNASKED and not ours:
        return UNASKED[state], state in LOST
    # Once may be a damaged letter; a second time it is the firmware's own word.
    if state not in KNOWN and again:
        return (
            f"the controller reports the state {report.state!r}, which is not known here",
            "Idle or Run",
            f"see its firmware's manual, bring it to Idle, then {AGAIN}",
        ), False
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
