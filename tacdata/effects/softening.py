"""Softening after the first large strain (Mullins)."""

import numpy as np
from scipy.special import erf

from tacdata.chain.memory import running_max
from tacdata.effects.effect import Course, Effect, Family, Growth, Parameter, Response, State, Values


class Softening(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.SKIN_MEMORY
    equation = "q = q_e (1 - a erf((W_max - W) / (m W_all))), W = d^2.5 at that place, W_all its largest"
    source = "Ogden & Roxburgh, Proc. R. Soc. A 455 (1999) 2861"
    experiment = (
        "a virgin place against one pressed often, at equal depth; then deeper than ever there: it rejoins "
        "the virgin curve"
    )
    parameters = (
        Parameter("a", "1", "softened share", 0.08, 0.0, 0.9),
        Parameter("m", "1", "sharpness", 0.2, 0.02, 2.0, grid=(0.08, 0.3, 1.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        # Hertz: the force under a sphere grows as d^1.5, its work as d^2.5.
        work = np.maximum(state.depth, 0.0) ** 2.5
        largest = running_max(work, state.course.row_site)
        # While the work grows beyond its largest, the skin is on its virgin curve.
        return state.scaled(1 - values["a"] * erf((largest - work) / (values["m"] * max(float(work.max()), 1e-9))))


class SofteningOfDepth(Softening):
    """Softening after the first large strain, by the share of the deepest press so far."""

    equation = "q = q_e (1 - a erf((W_max - W) / (b W_max))), W = d^2.5 at that place"
    source = "Ogden & Roxburgh, Proc. R. Soc. A 455 (1999) 2861, with m = b W_max: Abaqus' Mullins effect"
    parameters = (
        Parameter("a", "1", "softened share", 0.08, 0.0, 0.9),
        Parameter("b", "1", "sharpness", 0.8, 0.05, 3.0, grid=(0.3, 1.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        work = np.maximum(state.depth, 0.0) ** 2.5
        largest = running_max(work, state.course.row_site)
        return state.scaled(1 - values["a"] * erf((largest - work) / (values["b"] * np.maximum(largest, 1e-9))))


class WearIn(Softening):
    """Each press at a place takes a little of the response."""

    source = "standard form"

    equation = "q = q_e (1 - a (1 - exp(-k / n))), k presses at that place before"
    experiment = "ten presses at a virgin place, an hour of rest, then again"
    parameters = (
        Parameter("a", "1", "lost share after many presses", 0.05, -0.9, 0.9),
        Parameter("n", "1", "presses until most is lost", 3.0, 0.3, 100.0, grid=(1.0, 5.0, 25.0)),
    )
    grows_with = Growth.PRESSES

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        # Earlier episodes at the same place; the first press finds it as it was made.
        presses = np.array([np.sum(course.site[:k] == course.site[k]) for k in range(course.episodes)], dtype=float)
        return state.scaled((1 + values["a"] * np.expm1(-presses / values["n"]))[course.episode])

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "no place was pressed twice" if len(set(course.site.tolist())) == course.episodes else ""
