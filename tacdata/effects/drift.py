"""Readings drift with the clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Parameter


class Drift(Effect):
    """Readings drift with the clock."""

    title = "Readings drift with the clock"
    catalogue = ("T12", "E2", "T20")
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s_i = s_i + r_i t / T, T the length of the recordings"
    source = "standard form"
    experiment = "readings without contact, through the whole session"
    parameters = (
        Parameter("r", "largest rise", "drift of the channel over all recordings", 0.02, -5.0, 5.0, per_channel=True),
    )
    follows_clock = True
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        scale = state.response.largest(state.signal)
        clock = state.course.time / max(float(state.course.time[-1]), 1e-9) - 0.5
        return replace(state, signal=state.signal + scale * clock[:, None] * values["r"])
