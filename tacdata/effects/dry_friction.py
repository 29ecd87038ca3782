"""Dry friction of a guide or a seal: the same force against every motion, at any rate and depth."""

from dataclasses import replace

import numpy as np

from tacdata.chain.memory import slipping
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, State, Values


class DryFriction(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "q = q_e + a q_top (1 + z) / 2, dz/dd = (1 - z sgn d') / w, z = -1 at every touch; q_top: q_e at the deepest "
        "point of the place"
    )
    source = "Coulomb, with presliding after Dahl, The Aerospace Corp. TOR-158 (1968)"
    experiment = (
        "strokes to three depths at three rates: the loop is as wide at every depth and rate, and opens within a short "
        "way after each reversal"
    )
    parameters = (
        Parameter("a", "1", "width of the loop over the largest load without it", 0.08, 0.0, 5.0),
        Parameter(
            "w", "1", "way by which it turns, over the deepest press", 0.01, 0.0005, 0.1, grid=(0.004, 0.02, 0.06)
        ),
    )
    at_rest = AtRest.STAYS

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        way = max(float(values["w"]) * course.span, 1e-9)
        depth = np.maximum(state.depth, 0.0)
        turn = 0.5 * float(values["a"]) * (1 + slipping(depth, way, course.first | (state.depth <= 0)))
        top = _deepest(course, depth)
        return replace(
            state, load=state.load + turn[:, None] * state.load[top], force=state.force + turn * state.force[top]
        )


def _deepest(course: Course, depth: np.ndarray) -> np.ndarray:
    """Return for each row the deepest row of its place and tool, shape (n,), int64."""
    of = np.unique(course.row_site * (int(course.tool.max()) + 1) + course.tool, return_inverse=True)[1]
    order = np.lexsort((depth, of))
    last = np.append(np.flatnonzero(np.diff(of[order])), len(order) - 1)
    return order[last][of]
