"""The skin is thicker or thinner than its model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Parameter


class Thickness(Effect):
    """The skin is thicker or thinner than its model."""

    title = "The skin is thicker or thinner than its model"
    catalogue = ("G1",)
    stage = "mechanics"
    moves = ("label", "signal", "force")
    group = "amplitude"
    equation = "q = q_e (1 - 2 e d / D) (1 - e): bonded thin layers soften with thickness, more at depth"
    source = "Johnson, Contact Mechanics, sec. 5.8: layers stiffen with a/h"
    experiment = "calliper; a flat punch touching off at the sensor's corners; neighbours over centre against depth"
    parameters = (Parameter("e", "1", "relative excess of thickness", 0.06, -0.5, 0.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        ease = (1 - values["e"]) * (1 - 2 * values["e"] * np.maximum(state.depth, 0.0) / state.course.span)
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot tell of it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
