"""GRBL's error and alarm numbers in words (Grbl v1.1 interface documentation, "Message Summary")."""

from __future__ import annotations

ERRORS = {
    1: "a G-code word must begin with a letter",
    2: "a number is missing or malformed",
    3: "this $ command is not known",
    4: "a negative value where a positive one is expected",
    5: "homing is switched off ($22=0)",
    6: "the step pulse must be at least 3 microseconds",
    7: "reading the stored settings failed; the defaults were restored",
    8: "this $ command is only taken when the machine is idle",
    9: "locked out: in alarm or jogging, G-code is not taken",
    10: "soft limits need homing to be switched on ($22=1)",
    11: "the line is longer than the controller's line buffer",
    12: "this setting asks for a step rate above what the controller can do",
    13: "the safety door is open",
    14: "the build information or start-up line is longer than its memory",
    15: "the jog goes beyond the machine's travel; it was not begun",
    16: "the jog command lacks '=' or holds forbidden G-code",
    17: "laser mode needs a spindle output with PWM",
    20: "an unsupported or invalid G-code command",
    21: "two commands of the same modal group in one line",
    22: "the feed rate is not set",
    23: "this command needs an integer value",
    24: "two commands in one line both want the axis words",
    25: "a word appears twice in one line",
    26: "this command needs axis words, and there are none",
    27: "the line number is out of range",
    28: "a value that this command needs is missing",
    29: "this work coordinate system is not supported (only G54 to G59)",
    30: "G53 is only allowed with G0 and G1",
    31: "axis words without a command that takes them",
    32: "G2 and G3 need at least one axis word in their plane",
    33: "the motion's target is invalid",
    34: "the arc's radius is invalid",
    35: "G2 and G3 need at least one offset in their plane",
    36: "words that no command of the line takes",
    37: "G43.1 applies to no axis but the one set up for tool length",
    38: "the tool number is greater than the greatest allowed",
}
"""``error:N``: why a line was refused. 18 and 19 are not used by GRBL 1.1."""

ALARMS = {
    1: "a hard limit switch closed; the position is probably lost, home again",
    2: "the target lies beyond the soft limits; the position is kept",
    3: "reset while moving; steps may be lost and the position is suspect, home again",
    4: "the probe was not in its initial state before the probing move",
    5: "the probe did not touch within its travel",
    6: "homing was interrupted by a reset",
    7: "homing was interrupted by the safety door",
    8: "homing failed: the limit switch did not open on pulling off",
    9: "homing failed: no limit switch was found",
}
"""``ALARM:N``: why motion stopped and is locked."""


def error_in_words(code: int) -> str:
    """Return ``error:N`` with its meaning."""
    return f"error:{code} ({ERRORS.get(code, 'not a GRBL 1.1 code; see the list of the firmware')})"


def alarm_in_words(code: int) -> str:
    """Return ``ALARM:N`` with its meaning."""
    return f"ALARM:{code} ({ALARMS.get(code, 'not a GRBL 1.1 code; see the list of the firmware')})"
