"""The skin is thicker or thinner than its model.

Finite elements give the true change 1 mm deep (24 protrusions, held at the sides). Of the part that a common gain
leaves unexplained, the spread of the load below explains 89 % (-0.78 e, not -e; `benchmarks/README.md`).
"""

from dataclasses import replace

import numpy as np

from tacdata.effects.effect import Effect, Family, LikeGain, Parameter, State, Values

STEP = 0.05
"""Half the step of lateral finite differences [mm]."""
FAINT = 1e-3
"""Smallest load, over a row's largest, of which the fall-off is determined [1]."""
STEEPEST = 8.0
"""Highest power of the distance by which a load falls off [1]."""


class Thickness(Effect):
    stage = "mechanics"
    moves = ("label", "signal", "force")
    group = "amplitude"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = (
        "q = q_e (1 - e (1 + d / D) / 2) exp(-e (2 + r grad ln q_e)): a thicker layer is softer, and spreads more"
    )
    source = (
        "force: 0.5 to 0.9 e less for a / h of 0.3 to 0.6, Dimitriadis et al., Biophys. J. 82 (2002) 2798; "
        "loads under a layer by similarity: P g(r / h) / h^2"
    )
    experiment = "measure the skin with a calliper; touch off with a flat punch at the sensor's corners"
    parameters = (Parameter("e", "1", "relative excess of thickness", 0.06, -0.5, 0.5),)
    like_gain = LikeGain.SIMILAR
    changes_skin = True

    def apply(self, state: State, values: Values) -> State:
        ease = 1 - 0.5 * values["e"] * (1 + np.clip(state.depth / state.course.span, 0.0, 1.0))
        # Bounded: far from the tip loads fall off so steeply that the first order in e no longer holds.
        spread = np.exp(np.clip(-values["e"] * (2 + falls(state)), -1.0, 1.0))
        return replace(state, load=state.load * ease[:, None] * spread, force=state.force * ease)

    def thickness_factor(self, values: Values) -> float:
        return 1 + float(values["e"])


def falls(state: State) -> np.ndarray:
    """Return r grad ln q, the power of the distance by which each load falls off [1], shape (n, channels).

    It is -2 on average over the face if loads are conserved. It is set to -2 if the places of channels are unknown.
    """
    course, pose = state.course, state.pose
    load = state.response.load(pose, course.tool)
    if course.centers is None:
        return np.full(load.shape, -2.0)
    result = np.zeros_like(load)
    for axis in range(2):
        by = STEP * np.eye(3)[axis]
        further, nearer = (state.response.load(pose + sign * by, course.tool) for sign in (1, -1))
        result += (further - nearer) / (2 * STEP) * (pose[:, axis, None] - course.centers[:, axis])
    floor = np.maximum(FAINT * np.abs(load).max(axis=1, keepdims=True, initial=0.0), 1e-12)
    return np.clip(result / np.maximum(load, floor), -STEEPEST, STEEPEST)
