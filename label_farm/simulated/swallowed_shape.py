"""Whether a solved press shows skin above its shape: an older solver's thin shape that the skin swallowed.

Solvers before the check of passages (`tacdata.skin.contact.passage_check`) took it for an equilibrium when the skin had
come out on the far side of a thin shape. A file of solved presses keeps no displacements. But it keeps the map, and no
skin is above the underside of its indenter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tacdata.indenters import Indenter, from_document
from tacdata.label_farm.presses.job import Job
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    from tacdata.skin.press import PressRequest

_LEAST, _SHARE = 0.1, 0.25
"""Height above the underside from which on skin has passed through [mm], and the share of the depth that is added [1].

A mesh that is coarse under a sharp edge reaches a tenth of the depth into the shape."""

_AROUND = 0.25
"""How far around a pixel the highest underside is sought [mm]: next to an edge, maps are of whole elements."""

_STEPS = 8
"""Fixed-point steps to the place of a leaning shape under a pixel; the lean is at most 30 degrees."""


def swallowed_at(job: Job, sensor: Sensor, solution: PathSolution) -> float | None:
    """Return the first depth [mm] at which the map is above the shape; None without one.

    Args:
        job: The press.
        sensor: The specimen that it presses. Skins whose surface is a file are not judged.
        solution: The solved path.
    """
    from tacdata.skin.press import PressRequest

    if sensor.skin.surface is not None:
        return None
    shape = from_document(job.indenter)
    bottom = underside(
        PressRequest(shape, job.x, job.y, job.yaw, job.depths, tilt_x=job.tilt_x, tilt_y=job.tilt_y), sensor
    )
    for depth, surface in zip(solution.depth.tolist(), solution.surface, strict=True):
        if (depth - bottom - surface > _LEAST + _SHARE * depth).any():
            return depth
    return None


def underside(request: PressRequest, sensor: Sensor) -> np.ndarray:
    """Return a shape's underside height above the press's depth [mm].

    Args:
        request: The press.
        sensor: The pressed sensor.

    Returns:
        Of the map's pixels, shape (pixels_x, pixels_y); inf outside the shape.
    """
    from tacdata.skin.contact.first_touch import rise, rotation

    shape, grid, skin = request.indenter, sensor.map, sensor.skin
    turn = rotation(request)
    x, y = np.meshgrid(grid.x, grid.y, indexing="ij")
    sides = _AROUND * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    height = np.max([_height(shape, turn, x - request.x + dx, y - request.y + dy) for dx, dy in sides], axis=0)
    return height + rise(shape, turn) + skin.outer_height(request.x, request.y) - skin.outer_height(x, y)


def _height(shape: Indenter, turn: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of a turned shape's underside over its origin at (x, y) [mm], ``inf`` outside it."""
    place = np.stack([x, y, np.zeros_like(x)])
    for _ in range(_STEPS):
        local = np.einsum("ji,jkl->ikl", turn, place)
        bottom = shape.profile(local[0], local[1])
        local[2] = np.where(np.isfinite(bottom), bottom, 0.0)
        place[2] = np.einsum("i,ikl->kl", turn[2], local)
    return np.where(np.isfinite(bottom), place[2], np.inf)
