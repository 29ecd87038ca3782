"""The indenter is felt before it touches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Proximity(Effect):
    """The indenter is felt before it touches."""

    title = "The indenter is felt before it touches"
    catalogue = ("T14",)
    stage = "readout"
    moves = ("signal",)
    group = "depth offset"
    family = Family.CONTACT
    equation = "s_i = s_i + a w_i exp(d / l) for d < 0, w_i by the pattern at a tenth of the deepest depth"
    source = "standard form"
    experiment = "plastic against metal indenter, grounded or not"
    parameters = (
        Parameter("a", "1", "rise at touch over that at a tenth of the depth", 0.2, -10.0, 10.0),
        Parameter("l", "mm", "range", 0.5, 0.05, 10.0, grid=(0.2, 1.0)),
    )

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        pose = state.pose.copy()
        pose[:, 2] = 0.1 * state.course.span
        pattern = state.response.signal(state.response.load(pose, state.course.tool)) - idle
        near = np.exp(np.minimum(state.depth, 0.0) / values["l"])
        return replace(state, signal=state.signal + values["a"] * near[:, None] * pattern)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        if response.fitted:
            return "a fitted response takes up whatever has no memory"
        return "nothing was recorded before touch" if course.tip[:, 2].min() > -0.05 else ""
