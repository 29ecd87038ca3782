"""The indenter sticks on release."""

from dataclasses import replace

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values

NODES = 400
"""Points of the curve along which the contact peels."""
BEYOND = 0.02
"""Height above the touch that a path must reach to show a pull [deepest depth]."""
NEAR = 0.005
"""Half the step of the finite difference that gives the slope of the response [deepest depth]."""


class Adhesion(Effect):
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

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        leaving = np.zeros(course.rows, dtype=bool)
        for rows in np.split(np.arange(course.rows), np.flatnonzero(course.first)[1:]):
            # Only what has touched sticks: from the deepest row of an episode on, if that row is in contact.
            top = int(np.argmax(state.depth[rows]))
            leaving[rows[top:]] = state.depth[rows[top]] > 0
        pose = state.pose.copy()
        # The pattern of a light touch: at depth zero the response is zero and has none.
        pose[:, 2] = 0.1 * course.span
        pull = values["a"] * np.exp(-np.square(state.depth / values["w"])) * (leaving & (course.speed < 0))
        load = state.load - pull[:, None] * state.response.load(pose, course.tool)
        return replace(state, load=load, force=state.force - pull * state.response.force(pose, course.tool))


class AdhesionPinned(Adhesion):
    """The indenter sticks, and the contact stays as wide as it was until it peels."""

    equation = (
        "q = q_e(c) - q_e'(c) (c - d), c the depth at which the contact would be as wide without sticking: it stays "
        "until c - d = D (a (c / D)^(1/2))^(1/2), D the deepest depth, and peels along that curve"
    )
    source = "JKR with a free advance: Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301; c by its eq. 14"
    parameters = (Parameter("a", "1", "work of adhesion: square of the stretch over the depth", 0.03, 0.0, 4.0),)

    def apply(self, state: State, values: Values) -> State:
        course, depth = state.course, state.depth
        contact = _held(depth, _peeling(depth, float(values["a"]), course.span), course.first)
        sticks = contact > depth
        if not sticks.any():
            return state
        response, tool, near = state.response, course.tool, NEAR * course.span
        # While the contact stays as wide as it is, the skin unloads along a straight line, as under a flat punch: JKR's
        # construction.
        deeper, higher, as_is = (
            np.column_stack([state.pose[:, :2], z]) for z in (contact + near, contact - near, depth)
        )
        stretch = sticks * (contact - depth) / (2 * near)

        # The load at the depth of that contact is the mean of its neighbours: the slope needs them anyhow.
        def change(above: np.ndarray, below: np.ndarray, middle: np.ndarray) -> np.ndarray:
            by, on = (stretch, sticks) if middle.ndim == 1 else (stretch[:, None], sticks[:, None])
            return np.where(on, 0.5 * (above + below) - middle, 0.0) - by * (above - below)

        load = change(*(response.load(pose, tool) for pose in (deeper, higher, as_is)))
        force = change(*(response.force(pose, tool) for pose in (deeper, higher, as_is)))
        return replace(state, load=state.load + load, force=state.force + force)

    def unjudgeable(self, course: Course, response: Response) -> str:
        away = float(course.reduced.tip[:, 2].min()) < -BEYOND * course.span
        return "" if away else "nothing was read above the touch, where adhesion pulls and friction does not"


def _peeling(depth: np.ndarray, work: float, span: float) -> np.ndarray:
    """Return the largest contact before it peels, as the depth that gives this size without sticking, shape (n,)."""
    stretch = np.sqrt(max(work, 0.0)) * span
    # Below the depth at which even the least contact peels, it is lost.
    smallest = (0.25 * stretch / span**0.25) ** (4 / 3)
    deepest = max(float(depth.max()), 0.0) + stretch + span
    # Nodes are close where contacts are small: the curve is steepest there.
    contact = smallest + (deepest - smallest) * np.linspace(0.0, 1.0, NODES) ** 2
    stays_to = contact - stretch * (contact / span) ** 0.25
    return np.where(depth < stays_to[0], depth, np.maximum(np.interp(depth, stays_to, contact), depth))


def _held(low: np.ndarray, high: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return c_i = min(max(c_(i-1), low_i), high_i), c = low in first rows, shape (n,).

    Two such steps in a row are again such a step: all rows follow by doubling the number of joined steps.
    """
    low, high = low.copy(), np.where(first, low, high)
    high[:1], by = low[:1], 1
    while by < len(low):
        after_low, after_high = low[by:], high[by:]
        joined = [np.minimum(np.maximum(bound[:-by], after_low), after_high) for bound in (low, high)]
        low, high = np.concatenate([low[:by], joined[0]]), np.concatenate([high[:by], joined[1]])
        by *= 2
    return low
