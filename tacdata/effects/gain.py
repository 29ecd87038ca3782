"""All channels read too much or too little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, GainKind, Parameter


class Gain(Effect):
    """All channels read too much or too little."""

    title = "All channels read too much or too little"
    catalogue = ("T1",)
    stage = "taxel"
    moves = ("signal",)
    group = "amplitude"
    family = Family.RESPONSE_CURVE
    equation = "s = (1 + e) s above idle"
    source = "standard form"
    experiment = "a reference capacitor in a taxel's place, or a force sensor: whether readings are off, or the skin"
    form_error = 0.02
    parameters = (Parameter("e", "1", "relative excess", 0.1, -0.9, 3.0),)
    gain = GainKind.COMMON

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        return replace(state, signal=idle + (state.signal - idle) * (1 + values["e"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
