"""Stress relaxation over many decades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import low_passes
from tacdata.effects.effect import AtRest, Effect, Family, Parameter


class PowerCreep(Effect):
    """Stress relaxation over many decades."""

    title = "Stress relaxation over many decades"
    catalogue = ("M1",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "hold time"
    family = Family.SKIN_MEMORY
    equation = "q = q_e - f mean of L_tau q_e over tau in geometric steps of 3 from tau0 to 243 tau0"
    source = "broad spectrum; Ferry, ch. 4"
    experiment = (
        "a hold of five time constants and as long a recovery, at two depths and three rates: the plateau is "
        "not zero and the relaxed share is the same at every depth"
    )
    parameters = (
        Parameter("f", "1", "relaxed share over the decades", 0.15, 0.0, 0.95),
        Parameter("tau0", "s", "shortest time constant", 0.1, 0.01, 10.0, grid=(0.05, 0.3, 2.0)),
    )
    at_rest = AtRest.RELAXES
    times_by_radius = 0.0
    mechanism = "relaxation"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        both = np.column_stack([state.load, state.force])
        taus = float(values["tau0"]) * 3.0 ** np.arange(6)
        both = both - values["f"] * low_passes(both, state.course.step, taus, np.full(6, 1 / 6))
        return replace(state, load=both[:, :-1], force=both[:, -1])
