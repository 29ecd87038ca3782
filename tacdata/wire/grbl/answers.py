"""Answers to a line: was it refused, and did it arrive as it was sent?

No released Grbl 1.1, grblHAL or FluidNC takes a checksum on a line: a changed one is carried out if it can be read.
Each can send a received line back before carrying it out: FluidNC with ``$GCode/Echo=on``, Grbl and grblHAL built with
``REPORT_ECHO_LINE_RECEIVED``. Such an echo is compared with the sent line. Without it, a changed line is noticed at the
next status report, as soon as the machine leaves the path that was sent (`tacdata.recording.motion.allowed_path`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from tacdata.errors import DeviceError
from tacdata.wire.grbl import codes
from tacdata.wire.grbl.lines import RESPONSE

ECHO = re.compile(r"^\[(?:MSG:\w+:? ?)?echo: ?(.*?)\]?$")
"""A received line sent back (Grbl's `report_echo_line_received`); FluidNC leaves the last bracket away."""

UNASKED_ANSWER = (
    "the controller sent {!r}, and no line was waiting for an answer: answers no longer belong to their lines",
    "one answer for each line",
    "see that no other program and no second controller uses this line, then start again",
)
"""Given, allowed, remedy of an answer too many."""


@dataclass
class SentLine:
    """A line that waits for its answer."""

    text: str
    answer: str | None = None
    pushed: list[str] = field(default_factory=list)
    """Other lines that came before its answer."""


def refusal(line: str, answer: str) -> DeviceError | None:
    """Return why a line was not carried out, by its answer; None if it was."""
    if answer == "ok":
        return None
    accepted = "a line that it accepts in its present state"
    what = repr(line) if line else "an empty line"
    if not (code := RESPONSE.match(answer)):
        return DeviceError(
            f"the line {line!r} was dropped by a reset", accepted, "send it again when the machine is idle"
        )
    why = codes.error_in_words(int(code[1])) if code[1] else answer
    # Lines of motion are made here and are well formed. So a syntax error of the controller means that bytes were
    # changed.
    damaged = code[1] and int(code[1]) in codes.DAMAGED_LINE
    return DeviceError(
        f"the controller refused {what}: {why}",
        accepted,
        "it was well formed: bytes of it were lost or changed on their way, so check cable, ground and baud rate, and "
        "that no other program sends bytes of its own"
        if damaged and not line.startswith("$")
        else "correct the controller's settings",
    )


def changed_on_its_way(sent: str, echo: str) -> DeviceError | None:
    """Return the fault of a line of motion that was sent back; None if it arrived as it was sent."""
    # Controllers differ in how they echo settings; only motion can hurt. Spaces and case carry no meaning in G-code.
    if sent.startswith("$") or "".join(echo.split()).upper() == sent.upper():
        return None
    return DeviceError(
        f"the line {sent!r} came back as {echo!r}: it was changed on its way, there or back",
        "an echo that is equal to what was sent",
        "check cable, ground and baud rate, then start again",
    )
