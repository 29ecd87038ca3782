"""A GRBL controller's settings, and their consequences for a recording."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tacdata.errors import DeviceError
from tacdata.wire.grbl.lines import MESSAGE, MM_PER_INCH, SETTING, STARTUP
from tacdata.wire.grbl.link import GrblLink

QUESTIONS = ("$I", "$$", "$#", "$G", "$N")
"""Queries sent at opening; Grbl answers them when idle or locked, and none moves anything."""
IMPOSSIBLE = 1e6
"""Rate [mm/min] or acceleration [mm/s^2] that no machine reaches: memory that was never written states 2147483.648."""
ALWAYS_ON = 255
"""``$1`` that keeps the motors powered."""
AXIS_WORD = re.compile(r"[XYZ]")
STATE = ("$G", "$#")
"""Query for the modal state alone."""
UNDONE_BY = {
    "G51": ("G50", "scaling of the axes"),
    "G68": ("G69", "rotation of the axes"),
    "G43": ("G49", "tool length offset"),
    "G43.1": ("G49", "tool length offset"),
    "G43.2": ("G49", "tool length offset"),
    "G92": ("G92.1", "offset of the axes"),
    "G20": ("G21", "inches"),
    "G91": ("G90", "relative positions"),
    "G93": ("G94", "inverse time feed"),
    "G95": ("G94", "feed per turn"),
    "G7": ("G8", "x as a diameter"),
    "M3": ("M5", "spindle on"),
    "M4": ("M5", "spindle on, backwards"),
    "M53": ("M53P1", "feed hold switched off"),
}
"""Modal state that changes coordinates or speeds, turns the tip, or lets it go on -> the word that ends it, and its
description. Every move contains G53, G90, G21 and G94, but grblHAL scales and rotates G53 lines too.
"""


@dataclass(frozen=True)
class GrblSettings:
    """The controller's answers at opening."""

    answers: dict[str, str]
    """Settings and start-up lines by name (``$110``, ``$N0``), other answers by tag (``VER``, ``G54``)."""

    @classmethod
    def read(cls, link: GrblLink, timeout: float, questions: tuple[str, ...] = QUESTIONS) -> GrblSettings:
        """Send all queries; each answer may take ``timeout`` [s of the clock].

        Raises:
            DeviceError: If a question is refused or not answered.
        """
        answers: dict[str, str] = {}
        for question in questions:
            for pushed in link.command(question, timeout)[0]:
                if line := STARTUP.match(pushed):
                    answers[pushed.partition("=")[0]] = line[1]
                elif setting := SETTING.match(pushed):
                    answers[setting[1]] = setting[2]
                elif message := MESSAGE.match(pushed):
                    again = message[1] in answers and message[1] != "GC"  # grblHAL also sends it when it changes
                    prefix = f"{answers[message[1]]}; " if again else ""
                    answers[message[1]] = prefix + message[2]
        return cls(answers)

    @property
    def unit(self) -> float:
        """Report units to mm (``$13``)."""
        return MM_PER_INCH if self.number("$13") else 1.0

    @property
    def reports_by_itself(self) -> bool:
        """Whether grblHAL's ``$481`` is set."""
        return bool(self.number("$481"))

    @property
    def rx_bytes(self) -> int | None:
        """Size of the receive buffer by ``[OPT:codes,blocks,bytes...]`` [bytes]; None if it is not stated."""
        parts = self.answers.get("OPT", "").split(",")
        return int(parts[2]) if len(parts) > 2 and parts[2].isdigit() else None

    @property
    def is_hal(self) -> bool:
        """Whether the firmware is grblHAL."""
        return "grblHAL" in self.answers.get("FIRMWARE", "")

    @property
    def homing(self) -> bool:
        """Whether homing is switched on (bit 0 of ``$22``; grblHAL has more)."""
        return bool(int(self.number("$22")) & 1)

    @property
    def work_offset(self) -> np.ndarray | None:
        """Work coordinate offset [report units], shape (3,): the active G54 to G59.3, G92 and the tool's length."""
        active = re.search(r"G5\d(?:\.\d)?", self.answers.get("GC", ""))
        try:
            # Grbl starts in G54.
            parts = [self._triple(active[0] if active else "G54"), self._triple("G92")]
            tool = [float(value) for value in self.answers.get("TLO", "0").split(",")]
        except (KeyError, ValueError):
            return None
        # Grbl states one number, for z; grblHAL one for each axis.
        length = np.array(tool[:3]) if len(tool) >= 3 else np.array([0.0, 0.0, tool[0]])
        return np.sum([*parts, length], axis=0)

    @property
    def bent_by(self) -> tuple[str, ...]:
        """Modal state that changes coordinates, by its G word (`UNDONE_BY`)."""
        modal = (word.split(":")[0] for word in self.answers.get("GC", "").split())  # grblHAL: G51:XYZ
        words = [word for word in modal if word in UNDONE_BY]
        for tag, word in (("G92", "G92"), ("TLO", "G43.1")):
            # Both answers may state it, and it is ended once.
            already = any(UNDONE_BY[w][0] == UNDONE_BY[word][0] for w in words)
            if any(_numbers(self.answers.get(tag, ""))) and not already:
                words.append(word)
        return tuple(words)

    @property
    def travel(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Machine box of the soft limits [mm], shapes (3,) and (3,), if they are on (``$20``, ``$130``-``$132``).

        Machine zero is where homing ends and all positions are negative, unless the firmware was built to put the
        origin at the switch (``Z`` in OPT; grblHAL: bit 3 of ``$22``), where axes homing downwards count upwards.
        """
        length = np.array([self.number(f"$13{axis}") for axis in range(3)])
        if not self.number("$20") or not np.all(length > 0):
            return None
        built_so = "Z" in self.answers.get("OPT", "").partition(",")[0]
        # A homed axis of Grbl runs from 0 to the negative of its travel, whatever side its switch is on. Built with "Z"
        # (origin forced) zero is at the switch. grblHAL has a bit for it.
        at_switch = bool(int(self.number("$22")) & 8) if self.is_hal else built_so
        upwards = np.array([bool(int(self.number("$23")) >> axis & 1) for axis in range(3)]) & at_switch
        return np.where(upwards, 0.0, -length), np.where(upwards, length, 0.0)

    @property
    def cautions(self) -> tuple[str, ...]:
        """Remarks before the first move."""
        remarks = []
        if not self.number("$20"):
            remarks.append("soft limits are off ($20=0): only the rig file's envelope keeps the guide in bounds")
        if not self.homing:
            remarks.append("homing is off ($22=0): machine zero is where the controller was switched on or reset")
        if (delay := self.number("$1")) != ALWAYS_ON:
            remarks.append(
                f"motors are switched off {delay:g} ms after each move ($1={delay:g}): the tip can give way while it "
                "holds; $1=255 keeps them on"
            )
        return tuple(remarks)

    def refuse_moves_at_start(self, port: str) -> None:
        """Refuse start-up lines that move: they would run at every reset, and a fault is answered by a reset.

        Raises:
            DeviceError: Naming the line.
        """
        for name, line in self.answers.items():
            if name.startswith("$N") and AXIS_WORD.search(line.upper()):
                raise DeviceError(
                    f"the controller on {port} runs {line!r} at every reset ({name})",
                    "start-up lines without axis words",
                    f"clear it in the controller ({name}=)",
                )

    def limits(self, prefix: str, divisor: float, port: str) -> np.ndarray:
        """Return three axis settings divided by ``divisor``, shape (3,), for example the rates for ``$11``.

        Raises:
            DeviceError: If one is missing, not positive, or too great for any machine.
        """
        values = np.array([self.number(f"{prefix}{axis}") for axis in range(3)]) / divisor
        if np.any(values * divisor >= IMPOSSIBLE):
            stated = ", ".join(f"{value * divisor:g}" for value in values)
            raise DeviceError(
                f"the controller on {port} states {prefix}0 to {prefix}2 as {stated}",
                f"numbers below {IMPOSSIBLE:g}: its stored settings are damaged",
                "restore them in a terminal ($RST=$), set the machine's own, then home it",
            )
        if not np.all(values > 0):
            raise DeviceError(
                f"the controller on {port} reports no usable {prefix}0 to {prefix}2",
                "a positive rate and acceleration for each axis",
                "open it first; if it is open, correct these settings in the controller",
            )
        return values

    def number(self, name: str) -> float:
        """Return a setting as a number; 0 if it is absent or no number."""
        try:
            return float(self.answers.get(name, ""))
        except ValueError:
            return 0.0

    def _triple(self, name: str) -> np.ndarray:
        return np.array([float(value) for value in self.answers[name].split(",")[:3]])


def _numbers(text: str) -> list[float]:
    try:
        return [float(value) for value in text.split(",") if value]
    except ValueError:
        return []
