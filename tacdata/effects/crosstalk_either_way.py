"""Neighbours in the wiring speak to each other, one way more than the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.crosstalk import Crosstalk
from tacdata.effects.effect import Parameter


class CrosstalkEitherWay(Crosstalk):
    """Neighbours in the wiring speak to each other, one way more than the other."""

    title = "Neighbours in the wiring speak to each other, one way more than the other"
    equation = "s_i = s_i + b s_{i-1} + n s_{i+1} above idle"
    source = "charge left over from the channel that was read before"
    parameters = (
        Parameter("b", "1", "share of the channel before", 0.03, -0.4, 0.4),
        Parameter("n", "1", "share of the next channel", 0.03, -0.4, 0.4),
    )
    mechanism = "crosstalk"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        rise = state.signal - state.response.signal(np.zeros_like(state.load[:1]))
        more = np.zeros_like(rise)
        more[:, 1:] += values["b"] * rise[:, :-1]
        more[:, :-1] += values["n"] * rise[:, 1:]
        return replace(state, signal=state.signal + more)
