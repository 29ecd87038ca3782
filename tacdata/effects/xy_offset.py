"""Offset in x and y: lateral error of registration."""

import numpy as np

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class XyOffset(Effect):
    stage = "kinematics"
    moves = ("label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    memoryless = True
    word = "offset in x and y"
    equation = "(x, y) -> (x + dx, y + dy)"
    experiment = (
        "a cross of presses around one taxel from opposite sides; optical touch-off of the skin's edges separates "
        "a shifted skin from a shifted frame"
    )
    form_error = 0.02
    parameters = (
        Parameter("dx", "mm", "shift along x", 0.1, -2.0, 2.0),
        Parameter("dy", "mm", "shift along y", 0.1, -2.0, 2.0),
    )
    each_episode = True

    def apply(self, state: State, values: Values) -> State:
        return state.with_pose(state.pose + np.stack([values["dx"], values["dy"], np.zeros(())], axis=-1))
