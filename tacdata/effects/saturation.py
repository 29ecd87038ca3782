"""Readings level off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Saturation(Effect):
    """Readings level off."""

    title = "Readings level off"
    catalogue = ("T7",)
    stage = "taxel"
    moves = ("signal",)
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    equation = "s = s / (1 + k |s| / S) above idle, S the largest"
    source = "standard form"
    experiment = "deeper presses, and a histogram: readings pile up at one value, whatever the depth"
    parameters = (Parameter("k", "1", "loss at the largest reading", 0.1, 0.0, 5.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        rise = state.signal - idle
        return replace(state, signal=idle + rise / (1 + values["k"] * np.abs(rise) / max(np.abs(rise).max(), 1e-12)))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
