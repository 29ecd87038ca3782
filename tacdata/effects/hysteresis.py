"""Internal friction, whatever the rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import slip_lags
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class Hysteresis(Effect):
    """Internal friction, whatever the rate."""

    title = "Internal friction, whatever the rate"
    catalogue = ("M6", "G10")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "q = q_e - a q_e / F_e (F_e - mean of stop_r F_e over r of 0.05, 0.15, 0.4 of the largest force), anew at "
        "every touch: what nothing presses holds no friction"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2"
    experiment = "slow loops at three rates: the loop's area stays as the rate goes to 0, and its width grows with load"
    parameters = (Parameter("a", "1", "share carried by friction", 0.1, 0.0, 3.0),)
    at_rest = AtRest.STAYS

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        force = np.maximum(state.force, 0.0)
        largest = max(float(force.max()), 1e-12)
        free = state.depth <= 0
        lag = slip_lags(force, largest * np.array([0.05, 0.15, 0.4]), free).mean(axis=0)
        share = np.minimum(lag / np.maximum(force, 0.02 * largest), 3.0)
        ease = np.maximum(1 - values["a"] * share, 0.0)
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)
