"""The error and alarm numbers of Grbl 1.1 and grblHAL in words.

Sources: Grbl's ``doc/csv/error_codes_en_US.csv`` and ``alarm_codes_en_US.csv``; grblHAL's ``errors.h`` and
``alarms.h``, which keep Grbl's numbers and add to them.
"""

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
    18: "the reset input is active",
    19: "a value above 0 is expected",
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
    39: "a value is out of range",
    40: "a tool change is waiting to be acknowledged",
    41: "the spindle does not run",
    42: "this plane is not allowed for this command",
    43: "the feed rate is above the greatest allowed",
    44: "the spindle speed is out of range",
    45: "a limit switch is closed; home or move off it first",
    46: "the machine must be homed first ($H)",
    47: "an error of the tool table",
    48: "two values contradict each other",
    49: "the self-test failed; power it off and on",
    50: "the emergency stop is active",
    51: "a motor driver reports a fault",
    52: "the setting's value is out of range",
    53: "this setting is not available",
    54: "the retract position lies below the drill position",
    55: "the homing set-up tries to home an axis twice",
    56: "this coordinate system is locked",
    57: "an unexpected file demarcation",
    58: "the auxiliary port is not available",
    60: "the SD card could not be mounted",
    61: "the SD card's file could not be read",
    62: "the SD card's directory could not be read",
    63: "the SD card's directory does not exist",
    64: "the SD card is not mounted",
    65: "the file system is not mounted",
    66: "the file system is read-only",
    70: "Bluetooth did not start",
    71: "an unknown operation in an expression",
    72: "a division by zero in an expression",
    73: "an argument out of range in an expression",
    74: "an invalid argument in an expression",
    75: "a malformed expression",
    76: "an expression without a valid result",
    77: "a log-in is needed",
    78: "access is denied",
    79: "not allowed while a critical event is active; reset the controller",
    80: "this flow control only works in a macro",
    81: "malformed flow control",
    82: "flow control is nested too deeply",
    83: "flow control ran out of memory",
    84: "the file could not be opened",
}
"""``error:N``: why a line was refused. Grbl 1.1 uses 1 to 17 and 20 to 38; the others are grblHAL's."""

ALARMS = {
    1: "a hard limit switch closed, or noise on its line was taken for it; the position is probably lost, home again",
    2: "the target lies beyond the soft limits; the position is kept",
    3: "reset while moving; steps may be lost and the position is suspect, home again",
    4: "the probe was not in its initial state before the probing move",
    5: "the probe did not touch within its travel",
    6: "homing was interrupted by a reset",
    7: "homing was interrupted by the safety door",
    8: "homing failed: the limit switch did not open on pulling off",
    9: "homing failed: no limit switch was found",
    10: "the emergency stop is active; release it, then reset and home",
    11: "the machine must be homed before it takes anything else ($H)",
    12: "a limit switch is closed; move off it, then reset",
    13: "the probe's protection was triggered",
    14: "the spindle did not reach its speed",
    15: "homing failed: the second switch of a squared axis was not found",
    16: "the power-on self-test failed; power it off and on",
    17: "a motor driver reports a fault",
    18: "homing failed: the set-up is incomplete",
}
"""``ALARM:N``: why motion stopped and is locked. Grbl 1.1 uses 1 to 9 (10: homing of a dual axis)."""

UNKNOWN = "a code of neither Grbl 1.1 nor grblHAL; see the firmware's list"


HOMING_REQUIRED = 11
"""The alarm of a controller that was just switched on (grblHAL)."""
POSITION_KEPT = (2, 4, 5)
"""Alarms that keep the position: nothing moved, or the machine came to rest first."""
DEAF = (1, 2, 17)
"""Alarms of a machine at rest that obeys no line before a reset (grblHAL: ``error:79``, or no answer in older ones;
Grbl sends nothing at all then). The emergency stop is not among them: while it is active, a reset ends nothing.
"""
UNLOCK = "reset it (Ctrl-X) and unlock it ($X) in a terminal, which keeps the position; then start again"
"""Remedy of such an alarm; limit alarms take no ``$X`` before a reset."""
DAMAGED_LINE = (1, 2, 3, 4, 11, 20, 21, 22, 23, 24, 25, 26, 27, 28, 30, 31, 36)
"""Refusals that a correct line only gets if bytes of it were lost or changed on the way."""


def error_in_words(code: int) -> str:
    """Return ``error:N`` with its meaning."""
    return f"error:{code} ({ERRORS.get(code, UNKNOWN)})"


def alarm_in_words(code: int) -> str:
    """Return ``ALARM:N`` with its meaning."""
    return f"ALARM:{code} ({ALARMS.get(code, UNKNOWN)})"
