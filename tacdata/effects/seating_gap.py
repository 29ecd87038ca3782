"""The skin does not rest on its support."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class SeatingGap(Effect):
    """The skin does not rest on its support."""

    title = "The skin does not rest on its support"
    catalogue = ("G2",)
    stage = "contact"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.CONTACT
    equation = "q = max(0, q_e - g largest q_e)"
    source = "standard form"
    experiment = "touch off all over the skin: a zero error is the same everywhere, a gap is a dome"
    parameters = (Parameter("g", "1", "share of the largest load needed to close it", 0.02, 0.0, 0.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        lost = values["g"] * np.abs(state.load).max()
        return replace(state, load=np.sign(state.load) * np.maximum(np.abs(state.load) - lost, 0.0))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
