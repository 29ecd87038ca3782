"""Internal friction that is overcome gradually."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import slipping
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class BoucWen(Effect):
    """Internal friction that is overcome gradually."""

    title = "Internal friction that is overcome gradually, whatever the rate"
    catalogue = ("M6", "G10")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = "q = q_e (1 - a (1 - z) / 2), dz/dd = (1 - z sgn d') / w, z = -1 at every touch"
    source = "Bouc-Wen of exponent 1: Wen, J. Eng. Mech. Div. 102 (1976) 249; Dahl, The Aerospace Corp. TOR-158 (1968)"
    experiment = "slow loops at three rates: the loop's area stays as the rate goes to 0, and its width grows with load"
    parameters = (
        Parameter("a", "1", "lost share of load while unloading", 0.08, 0.0, 0.95),
        Parameter("w", "1", "way by which it turns, over the deepest press", 0.12, 0.01, 2.0, grid=(0.04, 0.12, 0.35)),
    )
    at_rest = AtRest.STAYS
    mechanism = "hysteresis"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        width = max(float(values["w"]) * course.span, 1e-9)
        z = slipping(np.maximum(state.depth, 0.0), width, course.first | (state.depth <= 0))
        ease = 1 - 0.5 * values["a"] * (1 - z)
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)
