"""Readings rise ever faster as the gap closes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class GapCurvature(Effect):
    """Readings rise ever faster as the gap closes."""

    title = "Readings rise ever faster as the gap closes"
    catalogue = ("T6",)
    stage = "taxel"
    moves = ("signal",)
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    equation = "s = s + k s^2 / S above idle, S the largest"
    source = "parallel plate: C = eps A / (g - u)"
    experiment = "presses with two indenters: a curve of the taxel is the same over readings, one of the skin is not"
    parameters = (Parameter("k", "1", "excess at the largest reading", 0.1, 0.0, 3.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        rise = state.signal - idle
        return replace(state, signal=idle + rise + values["k"] * rise * np.abs(rise) / max(np.abs(rise).max(), 1e-12))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
