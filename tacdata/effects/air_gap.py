"""Air between protrusions and taxels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class AirGap(Effect):
    """Air between protrusions and taxels."""

    title = "Air between protrusions and taxels"
    catalogue = ("G3", "G7")
    stage = "taxel"
    moves = ("signal",)
    group = "depth offset"
    family = Family.CONTACT
    equation = "s_i = max(0, s_i - g_i) above idle"
    source = "standard form"
    experiment = "approach every taxel slowly: over air the onset is late, and readings rise slowly at first"
    parameters = (Parameter("g", "1", "lost share of the channel's largest rise", 0.03, 0.0, 0.6, per_channel=True),)
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        rise = state.signal - idle
        lost = values["g"] * np.abs(rise).max(axis=0)
        return replace(state, signal=idle + np.sign(rise) * np.maximum(np.abs(rise) - lost, 0.0))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
