"""Degrees of freedom of a fitted response at the end of the chain: its splines, passed through the effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.model.fitted_response import FORM_ERROR, FittedResponse
from tacdata.effects import Placed

SMALL_SHARE = 0.01
"""How much of a spline is added: effects need not be linear in load [largest load]."""


class SplineResponse(Response):
    """A response whose channels are all equal but for a little of one spline each; the last has none."""

    fitted = True
    form_error = FORM_ERROR

    def __init__(self, response: FittedResponse, weight: float) -> None:
        """Keep the response and the weight of each spline [the source's unit]."""
        self._response, self._weight = response, weight

    def load(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the size of the loads with a little of each spline less its value in the air, and as it is.

        Shape (n, splines + 1).
        """
        basis = self._response.basis(np.broadcast_to(pose, (len(self._response.context), 3)))
        more = np.pad(basis - self._response.air, ((0, 0), (0, 1)))
        return self.force(pose, tool)[:, None] + self._weight * more

    def force(self, pose: np.ndarray, tool: np.ndarray) -> np.ndarray:
        """Return the force of the response as it is, shape (n,)."""
        return self._response.force(pose, tool)

    def signal(self, load: np.ndarray) -> np.ndarray:
        """Return the loads, shape (n, splines + 1)."""
        return load

    def largest(self, signal: np.ndarray) -> np.ndarray:
        """Return the largest rise without any spline, shape (1,): a little more of one is no other unit for all."""
        return super().largest(signal[:, -1:])


def taken_up(course: Course, response: Response, placed: Sequence[Placed]) -> np.ndarray | None:
    """Return the contribution of a unit of each spline to a reading, at the rows read, shape (m, splines).

    Where an effect changes the force in another way, each stream has its own: shape (m, channels + 1, splines).

    A model must not be blamed for splines that do not go through its own effects: a delayed response is made of delayed
    splines. Differences between channels are left out: features are shared by all. So is a press's memory of
    others: splines of another place would go on in this one, as freedom that the response does not have.

    Args:
        course: The recordings.
        response: Columns of pose alone are returned for one that was not fitted; None for none.
        placed: Effects of the model.
    """
    acting = [p for p in placed if not p.effect.by_channel]
    if not isinstance(response, FittedResponse) or not acting:
        return response.features(course.reduced)
    readings = _through(course, response, acting)
    force_values = [p.effect.of_force(p.values) for p in acting]
    if course.force is None or not any(force_values):
        return readings
    force = [p if values is None else replace(p, values=values) for p, values in zip(acting, force_values, strict=True)]
    return np.stack([*[readings] * course.channels, _through(course, response, force)], axis=1)


def _through(course: Course, response: FittedResponse, acting: Sequence[Placed]) -> np.ndarray:
    """Return the contribution of a unit of each spline to a reading, passed through effects, shape (m, splines)."""
    none = np.zeros((course.rows, response.width + 1))
    plain = replace(course, readings=none, centers=None, force=None, apart=True)
    little = SMALL_SHARE * max(float(np.abs(response.force(course.tip, course.tool)).max()), 1e-12)
    predicted = predict(plain, SplineResponse(response, little), acting).signal
    return ((predicted[:, :-1] - predicted[:, -1:]) / little + response.air)[course.read]
