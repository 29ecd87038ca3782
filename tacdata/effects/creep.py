"""Creep: readings go on growing at constant depth, and come back late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class Creep(Effect):
    """Creep: readings go on growing at constant depth, and come back late."""

    title = "Creep: readings go on growing at constant depth, and come back late"
    catalogue = ("M1", "M3")
    stage = "mechanics"
    moves = ("signal",)
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f (q_e - L_tau q_e): a share f follows the path late"
    source = "standard linear solid seen by its strain; Ferry, Viscoelastic Properties of Polymers, ch. 3"
    experiment = (
        "a hold of five time constants and as long a recovery, at three rates: a lag that does not shrink "
        "with the rate, and a reading that grows in the hold where relaxation lets it fall"
    )
    parameters = (
        Parameter("f", "1", "late share", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 1.0, 2.5, 6.0, 16.0, 60.0)),
    )
    at_rest = AtRest.GOES_ON

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        late = state.load - low_pass(state.load, state.course.step, float(values["tau"]))
        return replace(state, load=state.load - values["f"] * late)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a single row an episode" if course.rows <= 2 * course.episodes else ""
