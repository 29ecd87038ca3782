"""The frame warms up and grows."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class ThermalGrowth(Effect):
    stage = "kinematics"
    moves = ("label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz (1 - exp(-t / tau))"
    experiment = "touch off every few presses; readings without contact stay as they are"
    parameters = (
        Parameter("dz", "mm", "final growth", 0.05, -1.0, 1.0),
        Parameter("tau", "s", "time constant", 600.0, 60.0, 20000.0, grid=(200.0, 800.0, 3000.0)),
    )
    follows_clock = True

    def apply(self, state: State, values: Values) -> State:
        # None at the first row, where the zero was touched off.
        return state.deeper(values["dz"] * -np.expm1(-state.course.time / values["tau"]))
