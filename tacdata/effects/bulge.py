"""Far neighbours lose load: the skin is less compressible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Parameter


class Bulge(Effect):
    """Far neighbours lose load: the skin is less compressible."""

    title = "Far neighbours lose load: the skin is less compressible"
    catalogue = ("M8",)
    stage = "mechanics"
    moves = ("label", "signal")
    group = "lateral spread"
    equation = "q_i = q_i - k sum_j w_ij q_j over the second neighbours, w by distance"
    source = "standard form"
    experiment = "flat punch against sphere: the sign of far neighbours"
    parameters = (Parameter("k", "1", "share taken from far neighbours", 0.03, -0.5, 0.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        centers = state.course.centers
        if centers is None:
            return state
        distance = np.linalg.norm(centers[:, None] - centers, axis=-1)
        pitch = np.where(distance > 1e-9, distance, np.inf).min()
        ring = ((distance > 1.5 * pitch) & (distance < 3.2 * pitch)).astype(float)
        return replace(state, load=state.load - values["k"] * state.load @ ring)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot tell of it; empty if they may."""
        if course.centers is None:
            return "the places of the channels are not known"
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
