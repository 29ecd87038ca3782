"""Each press at a place takes a little of the response."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Growth, Parameter


class WearIn(Effect):
    """Each press at a place takes a little of the response."""

    title = "Each press at a place takes a little of the response"
    catalogue = ("M4", "E3")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.SKIN_MEMORY
    equation = "q = q_e (1 - a (1 - exp(-k / n))), k presses at that place before"
    source = "standard form"
    experiment = "ten presses at a virgin place, an hour of rest, then again"
    parameters = (
        Parameter("a", "1", "lost share after many presses", 0.05, -0.9, 0.9),
        Parameter("n", "1", "presses until most is lost", 3.0, 0.3, 100.0, grid=(1.0, 5.0, 25.0)),
    )
    grows_with = Growth.PRESSES
    mechanism = "softening"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        before = np.array([np.sum(course.site[:k] == course.site[k]) for k in range(course.episodes)], dtype=float)
        ease = 1 + values["a"] * np.expm1(-before / values["n"])
        ease = ease[course.episode]
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "no place was pressed twice" if len(set(course.site.tolist())) == course.episodes else ""
