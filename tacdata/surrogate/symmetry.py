"""Symmetry of a sensor: one press gives four."""

from __future__ import annotations

import numpy as np

from tacdata.indenters import Indenter
from tacdata.sensor import Sensor

_CLOSE = 1e-6
"""Difference of heights below which they count as equal [mm]."""


def foldable(sensor: Sensor, indenter: Indenter, yaw: float) -> bool:
    """Return whether mirroring a press along x or y mirrors the loads: a plain box under a symmetric shape."""
    if sensor.skin.surface is not None:
        return False
    x, y = _places(indenter)
    upright = _turned(indenter, x, y, yaw)
    return _same(upright, _turned(indenter, -x, y, yaw)) and _same(upright, _turned(indenter, x, -y, yaw))


def round_about_axis(indenter: Indenter) -> bool:
    """Return whether rotating an indenter about its axis changes nothing."""
    x, y = _places(indenter)
    upright = _turned(indenter, x, y, 0.0)
    # At odd angles, as a regular polygon repeats at none of them.
    return all(_same(upright, _turned(indenter, x, y, angle)) for angle in (17.0, 41.0, 90.0))


def mirrored(values: np.ndarray, sensor: Sensor, along_x: bool, along_y: bool) -> np.ndarray:
    """Return per-taxel values of the mirrored press, shape (..., taxels) with taxel k = i + columns j."""
    taxels = sensor.taxels
    grid = values.reshape(*values.shape[:-1], taxels.rows, taxels.columns)
    grid = grid[..., ::-1] if along_x else grid
    grid = grid[..., ::-1, :] if along_y else grid
    return grid.reshape(values.shape)


def _places(indenter: Indenter) -> tuple[np.ndarray, np.ndarray]:
    # Within half of the extent: at edges of a solid, where heights jump, rounding would decide.
    samples = np.linspace(-0.53, 0.53, 24) * indenter.extent
    x, y = np.meshgrid(samples, samples, indexing="ij")
    return x, y


def _turned(indenter: Indenter, x: np.ndarray, y: np.ndarray, yaw: float) -> np.ndarray:
    cos, sin = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return indenter.profile(cos * x + sin * y, cos * y - sin * x)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    # Beyond the indenter heights are infinite, and infinities have no difference.
    finite = np.isfinite(a) & np.isfinite(b)
    return bool((np.isfinite(a) == np.isfinite(b)).all() and np.allclose(a[finite], b[finite], atol=_CLOSE))
