"""Gain drifts with the clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Growth, Parameter


class GainDrift(Effect):
    """Gain drifts with the clock."""

    title = "Gain drifts with the clock"
    catalogue = ("T25", "M13")
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s (1 + k (t / T - 1/2)) above idle"
    source = "standard form"
    experiment = "the same press all through the session; a reference capacitor beside it tells electronics from skin"
    parameters = (Parameter("k", "1", "relative change over all recordings", 0.05, -1.5, 1.5),)
    follows_clock = True
    grows_with = Growth.TIME

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        clock = state.course.time / max(float(state.course.time[-1]), 1e-9) - 0.5
        return replace(state, signal=idle + (state.signal - idle) * (1 + values["k"] * clock)[:, None])
