"""Softening after the first large strain, by the share of the deepest press so far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import erf

from tacdata.chain import State
from tacdata.chain.memory import running_max
from tacdata.effects.effect import Effect, Family, Parameter


class SofteningOfDepth(Effect):
    """Softening after the first large strain, by the share of the deepest press so far."""

    title = "Softening after the first large strain, by the share of the deepest press so far"
    catalogue = ("M4",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.SKIN_MEMORY
    equation = "q = q_e (1 - a erf((W_max - W) / (b W_max))), W = d^2.5 at that place"
    source = "Ogden & Roxburgh, Proc. R. Soc. A 455 (1999) 2861, with m = b W_max: Abaqus' Mullins effect"
    experiment = (
        "a virgin place against one pressed often, at equal depth; then deeper than ever there: it rejoins "
        "the virgin curve"
    )
    parameters = (
        Parameter("a", "1", "softened share", 0.08, 0.0, 0.9),
        Parameter("b", "1", "sharpness", 0.8, 0.05, 3.0, grid=(0.3, 1.0)),
    )
    mechanism = "softening"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        work = np.maximum(state.depth, 0.0) ** 2.5
        most = running_max(work, state.course.row_site)
        ease = 1 - values["a"] * erf((most - work) / (values["b"] * np.maximum(most, 1e-9)))
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)
