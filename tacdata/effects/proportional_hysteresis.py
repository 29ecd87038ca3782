"""Internal friction in proportion to load, whatever the rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import play
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class ProportionalHysteresis(Effect):
    """Internal friction in proportion to load, whatever the rate."""

    title = "Internal friction in proportion to load, whatever the rate"
    catalogue = ("M6",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = "q = q_e (1 - a z), z from 0 to 1 as the force falls back by 2 w F_max: (play_w F + w - F) / (2 w)"
    source = "one element of Prandtl-Ishlinskii, scaled by load; Brokate & Sprekels, ch. 2"
    experiment = "slow loops at three rates: the loop's area stays as the rate goes to 0, and its width grows with load"
    parameters = (
        Parameter("a", "1", "lost share of load while unloading", 0.08, 0.0, 0.95),
        Parameter("w", "1", "half the turning width over the largest force", 0.1, 0.005, 1.0, grid=(0.02, 0.07, 0.2)),
    )
    at_rest = AtRest.STAYS
    mechanism = "hysteresis"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        force = np.maximum(state.force, 0.0)
        width = max(float(values["w"]) * float(force.max()), 1e-12)
        turned = np.clip((play(force, width, state.depth <= 0) + width - force) / (2 * width), 0.0, 1.0)
        ease = 1 - values["a"] * turned
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)
