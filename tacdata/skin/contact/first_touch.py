"""Where an indenter is at depth 0, and how far a press reaches: turned shapes and curved faces included.

A press's x and y are those of the shape's origin. Its depth is counted from the undeformed outer face at that (x, y)
down to the lowest point of the shape as it is turned. For an upright shape on a flat face that is its tip's depth.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import torch

from tacdata.indenters import Indenter
from tacdata.sensor import Sensor
from tacdata.skin.member.pose import turned
from tacdata.skin.press import PressRequest

if TYPE_CHECKING:
    from tacdata.skin.surface.outer_face import OuterFace

_SAMPLES, _ZOOMS, _NARROWER = 65, 8, 8.0
"""The lowest point is sought on a grid that is then narrowed about the best one, so many times by such a factor."""


def rotation(request: PressRequest) -> np.ndarray:
    """Return the rotation from the indenter's frame to the sensor's [1], shape (3, 3)."""
    return _rotation(request.yaw, request.tilt_x, request.tilt_y).copy()


@lru_cache(maxsize=1024)
def _rotation(*degrees: float) -> np.ndarray:
    """Every press asks three times, and many share their angles."""
    return turned(*(torch.tensor([np.radians(angle)]) for angle in degrees))[:, :, 0].numpy()


def rise(indenter: Indenter, turn: np.ndarray) -> float:
    """Return the height of a turned shape's origin above its lowest point [mm], 0 or more.

    Args:
        indenter: The shape.
        turn: Rotation to the sensor's frame, shape (3, 3).
    """
    lateral, up = turn[2, :2], turn[2, 2]
    # An upright shape has its origin at its lowest point by definition.
    if not np.abs(lateral).max() > 1e-12:
        return 0.0
    half, center, best = indenter.extent, np.zeros(2), 0.0
    # A narrowing grid, since profiles need not be smooth: surfaces from files have edges.
    for _ in range(_ZOOMS):
        samples = np.linspace(-half, half, _SAMPLES)
        x, y = np.meshgrid(center[0] + samples, center[1] + samples, indexing="ij")
        height = lateral[0] * x + lateral[1] * y + up * indenter.profile(x, y)
        lowest = np.unravel_index(height.argmin(), height.shape)
        best = min(best, float(height[lowest]))
        center, half = np.array([x[lowest], y[lowest]]), half / _NARROWER
    return -best


def touch(sensor: Sensor, face: OuterFace, request: PressRequest) -> np.ndarray:
    """Return the place of the indenter's origin at depth 0 [mm], shape (3,).

    Args:
        sensor: Whose skin.
        face: Its outer face, asked where the sensor file has no formula for it.
        request: The press.
    """
    if sensor.skin.surface is None:
        height = float(sensor.skin.outer_height(request.x, request.y))
    else:
        height = float(face.height(np.array([[request.x, request.y]]))[0])
    return np.array([request.x, request.y, height + rise(request.indenter, rotation(request))])


def reach(sensor: Sensor, request: PressRequest) -> tuple[float, float]:
    """Return how far the part of the shape below the undeformed face reaches from (x, y) along x and y [mm].

    At the greatest depth of the press. Over a surface from a file the face is taken as flat.
    """
    skin, turn, deepest = sensor.skin, rotation(request), max(request.depths)
    upright = abs(turn[2, 2] - 1) < 1e-12
    if upright and not skin.curved:
        return request.indenter.footprint(deepest, request.yaw)
    samples = np.linspace(-request.indenter.extent, request.indenter.extent, _SAMPLES)
    x, y = (g.ravel() for g in np.meshgrid(samples, samples, indexing="ij"))
    z = request.indenter.profile(x, y)
    local = np.stack([x, y, z])[:, np.isfinite(z)]
    place = turn @ local
    heights = [
        # Beside the skin there is no height: the rim's counts.
        np.clip(c + place[k], -h / 2, h / 2)
        for k, (c, h) in enumerate(((request.x, skin.size_x), (request.y, skin.size_y)))
    ]
    height = float(skin.outer_height(request.x, request.y))
    # Depth counts from first touch, which for a leaning shape is not at its origin.
    bottom = height + rise(request.indenter, turn) - deepest
    within = bottom + place[2] <= skin.outer_height(*heights)
    if not within.any():
        return 0.0, 0.0
    return float(np.abs(place[0, within]).max()), float(np.abs(place[1, within]).max())


def thickness_at(sensor: Sensor, request: PressRequest) -> float:
    """Return the thickness of the skin under (x, y) [mm], the upper limit of a depth."""
    skin = sensor.skin
    height = float(skin.outer_height(request.x, request.y))
    return min(skin.thickness, height) if skin.curved and skin.underside == "flat" else skin.thickness
