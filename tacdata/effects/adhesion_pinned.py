"""The indenter sticks, and the contact stays as wide as it was until it peels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter

NODES = 400
"""Of the curve along which the contact peels."""
BEYOND = 0.02
"""So far above the touch a tip must come that shows a pull [deepest depth]."""
NEAR = 0.005
"""Half the way over which the slope of the response is taken [deepest depth]."""


class AdhesionPinned(Effect):
    """The indenter sticks, and the contact stays as wide as it was until it peels."""

    title = "The indenter sticks, and the contact stays as wide as it was until it peels"
    catalogue = ("G11",)
    stage = "contact"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.CONTACT
    equation = (
        "q = q_e(c) - q_e'(c) (c - d), c the depth at which the contact would be as wide without sticking: it stays "
        "until c - d = D (a (c / D)^(1/2))^(1/2), D the deepest depth, and peels along that curve"
    )
    source = "JKR with a free advance: Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301; c by its eq. 14"
    experiment = "talc on the skin; other dwell times, preloads and radii change it, but not play of the drive"
    parameters = (Parameter("a", "1", "work of adhesion: square of the stretch over the depth", 0.03, 0.0, 4.0),)
    mechanism = "adhesion"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course, depth = state.course, state.depth
        wide = _held(depth, _peeling(depth, float(values["a"]), course.span), course.first)
        sticks = wide > depth
        if not sticks.any():
            return state
        response, tool, near = state.response, course.tool, NEAR * course.span
        deeper, higher, as_is = (np.column_stack([state.pose[:, :2], z]) for z in (wide + near, wide - near, depth))
        pulled = sticks * (wide - depth) / (2 * near)

        def change(above: np.ndarray, below: np.ndarray, there: np.ndarray) -> np.ndarray:
            by, on = (pulled, sticks) if there.ndim == 1 else (pulled[:, None], sticks[:, None])
            return np.where(on, 0.5 * (above + below) - there, 0.0) - by * (above - below)

        load = change(*(response.load(pose, tool) for pose in (deeper, higher, as_is)))
        force = change(*(response.force(pose, tool) for pose in (deeper, higher, as_is)))
        return replace(state, load=state.load + load, force=state.force + force)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        away = float(course.reduced.tip[:, 2].min()) < -BEYOND * course.span
        return "" if away else "nothing was read above the touch: what sticks pulls there, and friction does not"


def _peeling(depth: np.ndarray, work: float, span: float) -> np.ndarray:
    """Return how wide a contact may be at depths before it peels, as the depth that makes it so wide, shape (n,)."""
    most = np.sqrt(max(work, 0.0)) * span
    # Below the depth at which even the least contact peels, it is lost.
    least = (0.25 * most / span**0.25) ** (4 / 3)
    deepest = max(float(depth.max()), 0.0) + most + span
    wide = least + (deepest - least) * np.linspace(0.0, 1.0, NODES) ** 2
    stays_to = wide - most * (wide / span) ** 0.25
    return np.where(depth < stays_to[0], depth, np.maximum(np.interp(depth, stays_to, wide), depth))


def _held(low: np.ndarray, high: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return c_i = min(max(c_(i-1), low_i), high_i), c = low in first rows, shape (n,).

    Such steps joined are such a step: all rows are found by doubling how many are joined.
    """
    low, high = low.copy(), np.where(first, low, high)
    high[:1], by = low[:1], 1
    while by < len(low):
        after_low, after_high = low[by:], high[by:]
        joined = [np.minimum(np.maximum(bound[:-by], after_low), after_high) for bound in (low, high)]
        low, high = np.concatenate([low[:by], joined[0]]), np.concatenate([high[:by], joined[1]])
        by *= 2
    return low
