"""The guide lost steps at some moment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class LostSteps(Effect):
    """The guide lost steps at some moment."""

    title = "The guide lost steps at some moment"
    catalogue = ("K11",)
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "depth offset"
    family = Family.KINEMATICS
    equation = "d -> d + dz from a share s of the episodes on"
    source = "standard form"
    experiment = "home again, and repeat the reference press"
    form_error = 0.02
    odds = 0.1  # drives lose steps when they are overloaded: machines are built not to, and any moment will do
    parameters = (
        Parameter("dz", "mm", "lost", 0.05, -1.0, 1.0),
        Parameter(
            "s", "1", "share of the episodes before it", 0.3, 0.02, 0.98, grid=tuple(0.05 * k for k in range(1, 20))
        ),
    )
    follows_clock = True
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        after = state.course.episode >= values["s"] * state.course.episodes
        return replace(state, pose=state.pose + np.array([0.0, 0.0, 1.0]) * (values["dz"] * after)[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a single episode" if course.episodes < 2 else ""
