"""Stress relaxation, one exponential."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class Relaxation(Effect):
    """Stress relaxation, one exponential."""

    title = "Stress relaxation, one exponential"
    catalogue = ("M1", "M3", "T21")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f L_tau q_e, L_tau the first-order mean with time constant tau"
    source = "standard linear solid; Ferry, Viscoelastic Properties of Polymers, ch. 3"
    experiment = (
        "a hold of five time constants and as long a recovery, at two depths and three rates: the plateau is "
        "not zero and the relaxed share is the same at every depth; force relaxes with the skin, not with the "
        "taxel's dielectric"
    )
    parameters = (
        Parameter("f", "1", "relaxed share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.15, 0.4, 1.0, 2.5, 6.0, 16.0, 40.0, 120.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        both = np.column_stack([state.load, state.force])
        both = both - values["f"] * low_pass(both, state.course.step, float(values["tau"]))
        return replace(state, load=both[:, :-1], force=both[:, -1])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a single row an episode" if course.rows <= 2 * course.episodes else ""
