"""Search for the skin from above, in steps that are each ended by readings at rest."""

from __future__ import annotations

from collections import deque

import numpy as np

from tacdata.registration.probe import Probe

COARSE = 0.1
"""Fine step of the search [mm]."""
SPEED, LIFT_SPEED = 1.0, 5.0
"""Speeds downwards and upwards [mm/s]."""
FRAMES = 4
"""Readings averaged at each step [count]."""
ANSWER = 7.0
"""Minimum answer of a channel [standard deviations of its difference from the free steps], needed twice."""
FREE = 4
"""Last steps without an answer that the next one is compared with [count]. A slow drift is no answer."""


class ContactSearch:
    """Goes down over one place until a channel answers; goes on below an answer that was no contact."""

    def __init__(
        self,
        probe: Probe,
        place: tuple[float, float],
        top: float,
        heights: list[float],
        idle: np.ndarray,
        noise: np.ndarray,
    ) -> None:
        """Begin a search.

        Args:
            probe: The indenter.
            place: x and y [mm, machine].
            top: Its height above the skin [mm, machine].
            heights: Heights below it, falling [mm, machine].
            idle: Mean reading there [counts], shape (channels,).
            noise: Standard deviation of a reading [counts], shape (channels,).
        """
        self._probe, self._place, self._heights = probe, place, deque(heights)
        self._clear = top
        self._free = deque([idle], maxlen=FREE)
        self._unit = noise * np.sqrt(1 / FRAMES + 1 / (FREE * FRAMES))
        self._squares: list[float] = []

    def first_answer(self) -> float | None:
        """Go down; return the height at which a channel answers [mm, machine], or None at the last one.

        A channel answers twice, and no longer at the step above: noise and drift do not follow the indenter.
        """
        while self._heights:
            height = self._heights.popleft()
            reading = self._reading(height, SPEED)
            change = self._change(reading)
            if self._answers(change) and self._answers(self._change(reading := self._probe.read(FRAMES).mean)):
                above = self._reading(self._clear, LIFT_SPEED)
                if self._answers((reading - above) / self._unit):
                    return height
                self._free.clear()
                reading = above
            else:
                self._squares.append(float(np.mean(change**2)))
            self._free.append(reading)
            self._clear = height
        return None

    def go_on_below(self, height: float) -> None:
        """Go on below a height that was found free of contact [mm, machine]."""
        while self._heights and self._heights[0] >= height:
            self._heights.popleft()
        self._free.clear()
        self._free.append(self._reading(height, SPEED))
        self._clear = height

    def _reading(self, height: float, speed: float) -> np.ndarray:
        self._probe.go((*self._place, height), speed)
        return self._probe.read(FRAMES).mean

    def _change(self, reading: np.ndarray) -> np.ndarray:
        """Return the difference from the free steps [standard deviations], shape (channels,)."""
        return (reading - np.mean(self._free, axis=0)) / self._unit

    def _answers(self, change: np.ndarray) -> bool:
        # The rig at work may be noisier than at rest: drift, motors.
        excess = max(1.0, float(np.sqrt(np.mean(self._squares)))) if self._squares else 1.0
        return bool((np.abs(change) > ANSWER * excess).any())
