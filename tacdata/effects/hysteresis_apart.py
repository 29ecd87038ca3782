"""Internal friction that readings and force show each in its own way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import slip_lags
from tacdata.effects.effect import AtRest, Effect, Family, Parameter

THRESHOLDS = (0.15, 0.35, 0.55, 0.75, 1.0, 1.3, 1.7)
"""Of the elements that slip, over the largest of them [1]: about as many at any."""


class HysteresisApart(Effect):
    """Internal friction that readings and force show each in its own way."""

    title = "Internal friction that readings and force show each in its own way"
    catalogue = ("M6",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "q = q_e(d + b l), F = F_e(d - a l), l = mean of min(d, play_w d + w - d) over w up to w_max, "
        "anew at every touch: a foam stays dense on the way back, and its force falls"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2; slipping elements: Iwan, J. Appl. Mech. 34 (1967)"
    experiment = "slow loops at three rates, force beside readings: both loops' areas stay as the rate goes to 0"
    parameters = (
        Parameter("a", "1", "lost depth of the force over the lag", 0.1, 0.0, 3.0),
        Parameter("b", "1", "gained depth of the readings over the lag", 0.1, -3.0, 3.0),
        Parameter("w", "1", "largest half band over the deepest press", 0.15, 0.01, 2.0, grid=(0.08, 0.25)),
    )
    at_rest = AtRest.STAYS
    mechanism = "hysteresis"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course, depth, response = state.course, state.depth, state.response
        free, most = depth <= 0, float(values["w"]) * course.span
        behind = slip_lags(depth, most * np.array(THRESHOLDS), free)
        # No element lets go below the depth at which nothing presses: the lag ends there, and does not jump.
        late = np.clip(behind, 0.0, np.maximum(depth, 0.0)).mean(axis=0)
        late = late[:, None] * np.array([0.0, 0.0, 1.0])
        poses = state.pose, state.pose + values["b"] * late, state.pose - values["a"] * late
        load, more = (response.load(pose, course.tool) for pose in poses[:2])
        force, less = (response.force(pose, course.tool) for pose in poses[::2])
        return replace(state, load=state.load + more - load, force=state.force + less - force)

    def of_force(self, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return values by which readings would change as the force does."""
        return {**values, "b": -values["a"]}

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "" if course.force is not None else "no force was read beside the readings"
