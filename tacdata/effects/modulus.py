"""The skin is stiffer throughout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, LikeGain, Parameter


class Modulus(Effect):
    """The skin is stiffer throughout."""

    title = "The skin is stiffer throughout"
    catalogue = ("M9", "S7")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "amplitude"
    family = Family.RESPONSE_CURVE
    equation = "q = (1 + e) q_e"
    source = "linear elasticity: loads scale with the modulus"
    experiment = "a load cell or a kitchen scale under one press; a Shore coupon of the same batch"
    parameters = (Parameter("e", "1", "relative excess of the modulus", 0.1, -0.8, 3.0),)
    like_gain = LikeGain.EQUAL

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        return replace(state, load=state.load * (1 + values["e"]), force=state.force * (1 + values["e"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
