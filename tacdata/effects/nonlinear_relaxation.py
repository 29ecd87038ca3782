"""Stress relaxation that grows with depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class NonlinearRelaxation(Effect):
    """Stress relaxation that grows with depth."""

    title = "Stress relaxation that grows with depth"
    catalogue = ("M2",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f L_tau (q_e d / D), D the deepest depth"
    source = "quasi-linear form; Fung, Biomechanics, ch. 7"
    experiment = "step and hold at four depths on fresh sites"
    parameters = (
        Parameter("f", "1", "relaxed share at the deepest depth", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 2.5, 16.0, 60.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0
    memory_by_depth = True
    mechanism = "relaxation"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        both = np.column_stack([state.load, state.force])
        share = np.maximum(state.depth, 0.0)[:, None] / state.course.span
        both = both - values["f"] * low_pass(both * share, state.course.step, float(values["tau"]))
        return replace(state, load=both[:, :-1], force=both[:, -1])
