"""The skin stiffens with depth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Stiffening(Effect):
    """The skin stiffens with depth."""

    title = "The skin stiffens with depth"
    catalogue = ("M7", "G12")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "depth curvature"
    family = Family.RESPONSE_CURVE
    equation = "q = q_e (1 + k d / D), D the deepest depth"
    source = "second term of a series in strain; Yeoh, Rubber Chem. Technol. 66 (1993) 754"
    experiment = (
        "presses with two indenters: a law of the taxel is the same over readings, one of the skin over depth by radius"
    )
    parameters = (Parameter("k", "1", "stiffer at the deepest depth", 0.1, -0.9, 3.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        more = 1 + values["k"] * np.maximum(state.depth, 0.0) / state.course.span
        return replace(state, load=state.load * more[:, None], force=state.force * more)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
