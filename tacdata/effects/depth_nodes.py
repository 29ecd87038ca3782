"""The simulation is interpolated between solved depths."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values

CLOSE = 0.2
"""Largest spacing, over the deepest press, at which smooth curves follow any contact [1]."""


class DepthNodes(Effect):
    stage = "simulator"
    moves = ("label", "signal")
    group = "simulator"
    family = Family.SIMULATION
    memoryless = True
    form_error = 0.02
    equation = "s = s + s sin(2 pi d / p) a sin-cos pair, p the spacing of solved depths"
    experiment = "solve between the nodes: no recording is needed"
    parameters = (
        Parameter("s", "1", "sine part", 0.02, -0.5, 0.5),
        Parameter("c", "1", "cosine part", 0.02, -0.5, 0.5),
        Parameter("p", "mm", "spacing", 0.25, 0.05, 1.0, grid=(0.1, 0.25, 0.5)),
    )

    def apply(self, state: State, values: Values) -> State:
        angle = 2 * np.pi * np.maximum(state.depth, 0.0) / values["p"]
        # The cosine less 1, so that the wave is zero at first touch.
        wave = values["s"] * np.sin(angle) + values["c"] * (np.cos(angle) - 1)
        return state.with_signal(state.signal + (state.signal - state.idle) * wave[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        spacing = response.spacing
        # A response of another kind has no nodes.
        if spacing is not None and spacing < CLOSE * course.span:
            return f"depths were solved {spacing:.2g} mm apart or closer: errors of interpolation are far smaller"
        return super().unjudgeable(course, response)
