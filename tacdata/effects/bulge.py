"""Far neighbours lose load: the skin is less compressible."""

from dataclasses import replace

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class Bulge(Effect):
    stage = "mechanics"
    moves = ("label", "signal")
    group = "lateral spread"
    family = Family.CROSSTALK
    memoryless = True
    equation = "q_i = q_i - k sum_j w_ij q_j, w = exp(-((r_ij / p - l) / (0.35 l))^2), p the least pitch"
    source = "a bonded layer that keeps its volume rises at about its thickness: Johnson, Contact Mechanics, sec. 5.8"
    experiment = "the same presses with a flat punch and with a sphere: channels far away change their sign"
    parameters = (
        Parameter("k", "1", "share taken from far neighbours", 0.03, -0.5, 0.5),
        Parameter("l", "pitches", "how far away", 2.0, 1.0, 4.0, grid=(1.5, 2.0, 2.7)),
    )

    def apply(self, state: State, values: Values) -> State:
        centers = state.course.centers
        if centers is None:
            return state
        distance = np.linalg.norm(centers[:, None] - centers, axis=-1)
        # The distance of a channel from itself is no pitch.
        pitch = np.where(distance > 1e-9, distance, np.inf).min()
        ring = np.exp(-np.square((distance / pitch / values["l"] - 1) / 0.35))
        return replace(state, load=state.load - values["k"] * state.load @ ring)

    def unjudgeable(self, course: Course, response: Response) -> str:
        if course.centers is None:
            return "the places of the channels are not known"
        return super().unjudgeable(course, response)
