"""The frame warms up and grows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Parameter


class ThermalGrowth(Effect):
    """The frame warms up and grows."""

    title = "The frame warms up and grows"
    catalogue = ("K12",)
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz (1 - exp(-t / tau))"
    source = "standard form"
    experiment = "touch off every few presses; readings without contact stay as they are"
    parameters = (
        Parameter("dz", "mm", "final growth", 0.05, -1.0, 1.0),
        Parameter("tau", "s", "time constant", 600.0, 60.0, 20000.0, grid=(200.0, 800.0, 3000.0)),
    )
    follows_clock = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        grown = values["dz"] * -np.expm1(-state.course.time / values["tau"])
        return replace(state, pose=state.pose + np.array([0.0, 0.0, 1.0]) * grown[:, None])
