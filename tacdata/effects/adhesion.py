"""The indenter sticks on release."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.effects.effect import Effect, Family, Parameter


class Adhesion(Effect):
    """The indenter sticks on release."""

    title = "The indenter sticks on release"
    catalogue = ("G11",)
    stage = "contact"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.CONTACT
    equation = (
        "q = q_e - a k exp(-(d / w)^2) while it leaves after contact, k the pattern at a tenth of the deepest depth"
    )
    source = "shape after JKR: Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301"
    experiment = "talc on the skin; other dwell times, preloads and radii change it, but not play of the drive"
    parameters = (
        Parameter("a", "1", "pull over the load at a tenth of the depth", 0.3, 0.0, 10.0),
        Parameter("w", "mm", "range", 0.1, 0.01, 1.0, grid=(0.05, 0.2)),
    )

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        leaving = np.zeros(course.rows, dtype=bool)
        for rows in np.split(np.arange(course.rows), np.flatnonzero(course.first)[1:]):
            top = int(np.argmax(state.depth[rows]))
            leaving[rows[top:]] = state.depth[rows[top]] > 0
        pose = state.pose.copy()
        pose[:, 2] = 0.1 * course.span
        pull = values["a"] * np.exp(-np.square(state.depth / values["w"])) * (leaving & (course.speed < 0))
        load = state.load - pull[:, None] * state.response.load(pose, course.tool)
        return replace(state, load=load, force=state.force - pull * state.response.force(pose, course.tool))
