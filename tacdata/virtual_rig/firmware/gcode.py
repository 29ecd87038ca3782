"""Parses one line of the G-code of GRBL 1.1, with GRBL's error numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np

AXES = "XYZ"
GROUPS = {
    "motion": ("G0", "G1", "G80"),
    "plane": ("G17", "G18", "G19"),
    "units": ("G20", "G21"),
    "distance": ("G90", "G91"),
    "feed": ("G93", "G94"),
    "offset": ("G54", "G55", "G56", "G57", "G58", "G59"),
    "cutter": ("G40",),
    "length": ("G49", "G43.1"),
    "path": ("G61",),
    "once": ("G4", "G53", "G92", "G92.1"),
    "scaling": ("G50", "G51"),
    "stop": ("M0", "M2", "M30"),
    "spindle": ("M3", "M4", "M5"),
    "coolant": ("M7", "M8", "M9"),
}
"""Modal group -> the words that the emulator accepts; ``once`` is GRBL's non-modal group."""
GROUP_OF = {word: group for group, words in GROUPS.items() for word in words}
POWER_ON = {
    "motion": "G0",
    "offset": "G54",
    "plane": "G17",
    "units": "G21",
    "distance": "G90",
    "feed": "G94",
    "spindle": "M5",
    "coolant": "M9",
}
"""Modal state after a reset, in the order of ``$G``."""

WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")


class Refused(Exception):
    """A line that GRBL answers with ``error:N``."""

    def __init__(self, code: int) -> None:
        """Refuse with error number ``code``."""
        self.code = code
        super().__init__(f"error:{code}")


@dataclass
class Modal:
    """Modal state, which lasts from line to line."""

    words: dict[str, str] = field(default_factory=lambda: dict(POWER_ON))
    """Group -> active word."""
    feed: float = 0.0
    """Programmed feed [mm/min]."""
    scale: np.ndarray = field(default_factory=lambda: np.ones(3))
    """Factors of G51 [1], shape (3,); they bend G53 lines too."""
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """Offset of G92 [mm], shape (3,)."""
    length: float = 0.0
    """Tool length offset of G43.1 along z [mm]."""

    @property
    def said(self) -> str:
        """The active modal words, in ``$G``'s form."""
        scaled = "".join(axis for axis, factor in zip(AXES, self.scale, strict=True) if factor != 1)
        bent = {"G51": f"G51:{scaled}", "G43.1": "G43.1"}  # grblHAL names the scaled axes
        more = [bent[word] for group in ("scaling", "length") if (word := self.words.get(group)) in bent]
        return " ".join([*(self.words[group] for group in POWER_ON), *more])

    @property
    def unit(self) -> float:
        """Length unit of the program [mm]."""
        return 25.4 if self.words["units"] == "G20" else 1.0


@dataclass(frozen=True)
class Action:
    """Request of a line, besides modal changes."""

    dwell: float | None = None
    """Pause [s]."""
    target: np.ndarray | None = None
    """Where to go, machine coordinates [mm], shape (3,)."""
    rapid: bool = False
    """True for G0."""


def split(line: str) -> list[tuple[str, float]]:
    """Return the words of a line without comments and blanks.

    Raises:
        Refused: 1 for a stray character, 2 for a malformed number.
    """
    text = re.sub(r"\([^)]*\)|;.*", "", line).replace(" ", "").replace("\t", "").upper()
    words, at = [], 0
    while at < len(text):
        if not text[at].isalpha():
            raise Refused(1)
        match = WORD.match(text, at)
        if not match:
            raise Refused(2)
        words.append((match[1], float(match[2])))
        at = match.end()
    return words


def interpret(line: str, modal: Modal, position: np.ndarray, offset: np.ndarray, jog: bool = False) -> Action:
    """Apply a line's modal words and return the action that it asks for.

    Args:
        line: The line.
        modal: Modal state; changed only if the line is accepted and is no jog.
        position: Machine position where the motion so far will end [mm], shape (3,).
        offset: Work coordinate offset [mm], shape (3,).
        jog: True for the part after ``$J=``.

    Raises:
        Refused: With GRBL's error number.
    """
    commands, values = _sort(split(line))
    words = {**modal.words, **{g: w for g, w in commands.items() if g != "once"}}
    state = replace(modal, words=words)
    once = commands.get("once")
    # GRBL keeps neither feed nor modes from one jog to the next: each gives its own feed.
    if jog and (set(commands) - {"units", "distance", "once"} or once == "G4" or "F" not in values):
        raise Refused(22 if "F" not in values else 16)
    if "F" in values:
        if values["F"] < 0:
            raise Refused(4)
        state.feed = values["F"] * state.unit
    axes = [a for a in AXES if a in values]
    action = Action()
    if _takes_axes(state, commands, values, position, offset):
        axes = []
    elif once == "G4":
        if "P" not in values:
            raise Refused(28)
        if axes:
            raise Refused(36)
        action = Action(dwell=values["P"])
    elif axes:
        action = _motion(state, values, position, offset, once == "G53", jog)
    if not jog:
        vars(modal).update(vars(state))
    return action


def _takes_axes(
    state: Modal, commands: dict[str, str], values: dict[str, float], position: np.ndarray, offset: np.ndarray
) -> bool:
    """Process scaling, G92 and the tool's length; return whether the line's axis words belong to one of them."""
    if commands.get("once") == "G92.1":
        state.shift = np.zeros(3)
    if commands.get("once") == "G92":
        shift = [
            p - o - values[a] * state.unit if a in values else s
            for a, p, o, s in zip(AXES, position, offset, state.shift, strict=True)
        ]
        state.shift = np.array(shift)
    elif commands.get("scaling") == "G51":
        state.scale = np.array([values.get(axis, 1.0) for axis in AXES])
    elif commands.get("length") == "G43.1":
        state.length = values.get("Z", 0.0) * state.unit
    else:
        if commands.get("scaling") == "G50":
            state.scale = np.ones(3)
        state.length = 0.0 if commands.get("length") == "G49" else state.length
        return False
    return True


def _sort(words: list[tuple[str, float]]) -> tuple[dict[str, str], dict[str, float]]:
    commands: dict[str, str] = {}
    values: dict[str, float] = {}
    for letter, number in words:
        if letter in "GM":
            word = f"{letter}{number:g}"
            group = GROUP_OF.get(word)
            if group is None:
                raise Refused(20)
            if group in commands:
                raise Refused(21)
            commands[group] = word
        elif letter in values:
            raise Refused(25)
        elif letter in "XYZFPNST":
            values[letter] = number
        else:
            raise Refused(20)
    return commands, values


def _motion(
    state: Modal, values: dict[str, float], position: np.ndarray, offset: np.ndarray, machine: bool, jog: bool
) -> Action:
    motion = "G1" if jog else state.words["motion"]
    if motion == "G80":
        raise Refused(30 if machine else 31)
    if motion == "G1" and state.feed <= 0:
        raise Refused(22)
    target = position.copy()
    for i, axis in enumerate(AXES):
        if axis in values:
            length = values[axis] * state.unit
            if machine:
                target[i] = length * state.scale[i]
            else:
                zero = offset[i] + state.shift[i] + (state.length if axis == "Z" else 0.0)
                target[i] = length * state.scale[i] + (zero if state.words["distance"] == "G90" else position[i])
    return Action(target=target, rapid=motion == "G0")
