"""The skin is thicker or thinner than its model.

A common gain and the spread of the load below explain 89 % of what a gain alone leaves of the change that finite
elements find 1 mm deep (24 protrusions, held at the sides; -0.78 e instead of -e; `benchmarks/thickness_spread.py`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, LikeGain, Parameter

STEP = 0.05
"""Half the step of differences to the side [mm]."""
FAINT = 1e-3
"""Loads below this share of a row's largest are too faint to tell how they fall off [1]."""
STEEPEST = 8.0
"""No load falls off by a higher power of the distance [1]."""


class Thickness(Effect):
    """The skin is thicker or thinner than its model."""

    title = "The skin is thicker or thinner than its model"
    catalogue = ("G1",)
    stage = "mechanics"
    moves = ("label", "signal", "force")
    group = "amplitude"
    family = Family.RESPONSE_CURVE
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

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        ease = 1 - 0.5 * values["e"] * (1 + np.clip(state.depth / state.course.span, 0.0, 1.0))
        spread = np.exp(np.clip(-values["e"] * (2 + falls(state)), -1.0, 1.0))
        return replace(state, load=state.load * ease[:, None] * spread, force=state.force * ease)

    def thickness_factor(self, values: dict[str, np.ndarray]) -> float:
        """Return the skin's thickness over the nominal one [1]."""
        return 1 + float(values["e"])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""


def falls(state: State) -> np.ndarray:
    """Return r grad ln q, by which power of the distance each load falls off [1], shape (n, channels).

    Loads are conserved where that is -2 on average, over the face. Where no places of channels are known it is -2.
    """
    course, pose = state.course, state.pose
    whole = state.response.load(pose, course.tool)
    if course.centers is None:
        return np.full(whole.shape, -2.0)
    result = np.zeros_like(whole)
    for axis in range(2):
        by = STEP * np.eye(3)[axis]
        further, nearer = (state.response.load(pose + sign * by, course.tool) for sign in (1, -1))
        result += (further - nearer) / (2 * STEP) * (pose[:, axis, None] - course.centers[:, axis])
    floor = np.maximum(FAINT * np.abs(whole).max(axis=1, keepdims=True, initial=0.0), 1e-12)
    return np.clip(result / np.maximum(whole, floor), -STEEPEST, STEEPEST)
