"""Recognizes a line from a GRBL controller by its form (Grbl v1.1 interface documentation; grblHAL `report.c`)."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

MM_PER_INCH = 25.4

RESPONSE = re.compile(r"^(?:ok|error:\s*(?:\D*?(\d+)|(\S.*)))$")
"""An answer; group 1: the error's number, group 2: its text where a firmware writes texts without one."""
ALARM = re.compile(r"^ALARM:\s*(?:(\d+)|(\S.*))$")
"""An alarm; group 1: its number, group 2: its text where a firmware writes texts."""
WELCOME = re.compile(r"grbl(?:hal)? v?(\d+)\.(\d+)\S* \[", re.IGNORECASE)
SETTING = re.compile(r"^(\$[A-Z0-9]+)=([^\s(]*)")
STARTUP = re.compile(r"^\$N\d+=(.*)$")
MESSAGE = re.compile(r"^\[([A-Z][A-Z0-9. ]*):(.*)\]$")

BITS = {"1": True, "0": False}

OPENED_AGAIN = ("Hold:0", "Door:0")
"""States of a machine at rest that waits for a cycle start."""
MOVING = ("Run", "Jog", "Home")
"""States, without their substate, in which something moves."""
AT_REST = (*OPENED_AGAIN, "Door:1", "Idle", "Alarm")
"""States in which nothing moves."""
BRAKING = ("Hold:1", "Door:2", "Door:3", "Door:4")
"""States that end by themselves, in which a reset would lose steps: braking for a hold or a door, or going on (Grbl
``Door:3``, grblHAL ``Door:4``).
"""


@dataclass(frozen=True)
class StatusReport:
    """A status report as written, before the work offset is applied."""

    state: str
    """State with its substate, for example ``Hold:0``."""
    position: np.ndarray
    """First three axes [report units], shape (3,)."""
    is_work: bool
    """True if `position` is WPos, False if MPos."""
    offset: np.ndarray | None
    """Work coordinate offset WCO [report units], shape (3,), if the report has one."""
    feed: float
    """Feed rate [report units/min]; NaN if the report has none."""
    feed_override: float | None = None
    """Feed override [%], if the report has one."""
    pins: str = ""
    """Letters of the active inputs, for example ``Z`` for its limit switch, ``D`` for the door."""
    pendant: bool | None = None
    """Whether a pendant has control (grblHAL's ``MPG``), if the report states it."""
    scaled: str = ""
    """Letters of the axes that G51 scales (grblHAL's ``Sc``)."""
    homed: bool | None = None
    """Whether it was homed since it was switched on (grblHAL's ``H``), if the report states it."""


def parse_status(line: str) -> StatusReport | None:
    """Parse ``<State|MPos:x,y,z|...>``; None if the line is damaged.

    After the first two fields others may follow in any order or be absent; unknown ones are ignored. A report that
    was cut off and begun again counts from its last beginning. A position that is no number is no position.
    """
    if not (line.startswith("<") and line.endswith(">")):
        return None
    # The last "<": a report may follow the remains of one that was cut off.
    state, *fields = line[line.rfind("<") + 1 : -1].split("|")
    values: dict[str, list[float]] = {}
    texts: dict[str, str] = {}
    for field in fields:
        name, _, text = field.partition(":")
        if name in ("MPos", "WPos", "WCO", "FS", "F", "Ov"):
            try:
                values[name] = [float(number) for number in text.split(",")]
            except ValueError:
                return None
            # float() reads "nan" and "inf", which damaged digits can spell; no machine is there.
            if not np.all(np.isfinite(values[name])):
                return None
        else:
            texts[name] = text
    # Which of the two is sent depends on $10; a controller sends one of them.
    kind = "MPos" if "MPos" in values else "WPos"
    position, offset = values.get(kind, []), values.get("WCO")
    if not re.fullmatch(r"[A-Za-z]+(:\d+)?", state) or len(position) < 3 or (offset and len(offset) < 3):
        return None
    return StatusReport(
        state,
        np.array(position[:3]),
        kind == "WPos",
        np.array(offset[:3]) if offset else None,
        (values.get("FS") or values.get("F") or [float("nan")])[0],
        (values.get("Ov") or [None])[0],
        texts.get("Pn", ""),
        BITS.get(texts.get("MPG", "")),
        texts.get("Sc", ""),
        BITS.get(texts.get("H", "").partition(",")[0]),
    )
