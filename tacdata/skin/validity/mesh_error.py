"""How far the mesh leaves a result from the exact one: the same press on a coarser mesh.

Richardson's extrapolation: with edges of length h a quantity is off by C h^p, with edges of r h by C (r h)^p. From the
difference d of the two follows the error at h, |d| / (r^p - 1) (Richardson, Phil. Trans. R. Soc. A 210 (1911) 307-357;
Roache, J. Fluids Eng. 116 (1994) 405-413).

The force follows it: a coarser mesh is stiffer. A pixel of the map does not. Its sign of error depends on how the
elements lie there, and the errors of two irregular meshes have a correlation rho below 1. The mean square of their
difference is e^2 (r^2p + 1 - 2 rho r^p), which is Richardson's for rho = 1. It is taken over the neighbourhood that the
contact couples: where two meshes happen to agree at a pixel, the error is not 0. The estimate is a standard deviation.

Orders and correlation were measured on a slab of 6 x 6 x 2 mm under a sphere of 2 mm radius, 0.25 to 0.75 mm deep.
Eight meshes with edges of 0.87 to 0.30 mm were compared with the finest. With averaged volume changes (structured
meshes of 1.0 to 0.5 mm against 0.375 mm, `benchmarks/skin_error_ladder.py`):

- orders of 1.6 to 1.8 for the map, 1.3 to 3.4 for the force
- stated over true error of the map: 0.5 to 1.7, median 0.9; 94 % of the pixels are within a factor of two
- stated over true error of the force: 0.8 to 7, median 2; most where the true one crosses zero
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tacdata.sensor import Sensor

ORDER = 2.0
"""Order p of the map's error in the edge length [1]; measured 1.6 to 2.7, median 2.2; 1.7 with averaged volumes."""

CORRELATION = 0.4
"""Correlation rho of a pixel's errors on two meshes [1]; measured 0.38 on average, more between coarse meshes."""

FORCE_ORDER = 2.0
"""Order of the force's error [1]; measured 1.7 to 3.4, median 2.4, so that this errs on the safe side."""

_LEAST_RATIO = 1.2
"""Least ratio of edge lengths in the estimate [1]: with a smaller one it would divide by about 0."""

_STEEP = 1.5
"""Reach of a neighbourhood over the half width of the contact [1]: the map's error sits in the ring at its edge."""


@dataclass(frozen=True)
class Figures:
    """Maps and forces of k states of a press on one mesh."""

    depth: np.ndarray
    """Nominal depths [mm], shape (k,)."""
    surface: np.ndarray
    """Undeformed minus deformed height at the pixel centres [mm], shape (k, pixels_x, pixels_y)."""
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (k, 3)."""
    taxel_force: np.ndarray
    """Normal force on each protrusion [N], shape (k, taxels)."""

    @classmethod
    def joined(cls, parts: list[Figures]) -> Figures:
        """Return the states of several, one after another."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    def first(self, count: int) -> Figures:
        """Return the first states alone."""
        return Figures(*(getattr(self, field.name)[:count] for field in fields(self)))


@dataclass(frozen=True)
class NumericalError:
    """Estimated error of k states by the mesh alone; solver tolerances, law and geometry are not in it."""

    surface: np.ndarray
    """Of the map [mm], shape (k, pixels_x, pixels_y): one standard deviation."""
    force: np.ndarray
    """Of the force of the skin on the indenter, all components together [N], shape (k,)."""
    taxel_force: np.ndarray
    """Of the force on each protrusion [N], shape (k, taxels)."""
    remark: str
    """Missing part of the estimate; empty if it is complete."""

    @classmethod
    def none(cls, fine: Figures) -> NumericalError:
        """Return zeros, for states whose error is not asked for."""
        return cls(np.zeros_like(fine.surface), np.zeros_like(fine.depth), np.zeros_like(fine.taxel_force), "not asked")


def estimate(
    sensor: Sensor, fine: Figures, coarse: Figures, reach: float, ratio: float, remark: str = ""
) -> NumericalError:
    """Return the error of the finer states.

    Args:
        sensor: Gives the places of pixels and taxels.
        fine: All states of the press; loading first.
        coarse: Those states of the loading branch that a coarser mesh reached, a subset of the depths of ``fine``.
            At other depths the estimate is interpolated, and beyond the last it grows with the depth. If there are
            none, the error is the whole depth and the whole force.
        reach: Half width of the contact at the deepest state [mm].
        ratio: Edge length of the coarser mesh over that of the finer [1].
        remark: Carried along.
    """
    depths, ratio = fine.depth, max(ratio, _LEAST_RATIO)
    rows = [int(np.flatnonzero(np.abs(depths - depth) < 1e-9)[0]) for depth in coarse.depth]
    # Nothing to compare with: the whole result is stated as its error.
    if not len(rows) or coarse.depth.max() <= 0:
        force = np.linalg.norm(fine.force, axis=1)
        doubt = np.broadcast_to(depths[:, None, None], fine.surface.shape).copy()
        return NumericalError(doubt, force, np.abs(fine.taxel_force), remark)
    growth = ratio**ORDER
    # From the mean square of the difference, e^2 (r^2p + 1 - 2 rho r^p), solved for e.
    factor = 1 / np.sqrt(growth**2 + 1 - 2 * CORRELATION * growth)
    # The force follows Richardson's estimate, so that it has no correlation in it.
    factor_of_force = 1 / (ratio**FORCE_ORDER - 1)
    pixels = np.stack(np.meshgrid(sensor.map.x, sensor.map.y, indexing="ij"), axis=-1).reshape(-1, 2)
    taxels = sensor.taxels.centers
    pitch = max(sensor.taxels.pitch_x, sensor.taxels.pitch_y)
    # Averaged over the footprint, as two meshes agree at single pixels by chance.
    surface = _local(coarse.surface - fine.surface[rows], pixels, _STEEP * reach)
    # With at least one neighbour: on a single taxel two meshes may agree by chance.
    taxel = _local(coarse.taxel_force - fine.taxel_force[rows], taxels, max(_STEEP * reach, pitch))
    force = _along(coarse, fine.force[rows])

    def at_all(values: np.ndarray) -> np.ndarray:
        return _by_depth(coarse.depth, values, depths)

    surface, force, taxel = factor * surface, factor_of_force * force, factor_of_force * taxel
    return NumericalError(at_all(surface), at_all(force), at_all(taxel), remark)


def _local(difference: np.ndarray, places: np.ndarray, width: float) -> np.ndarray:
    """Return root mean squares of differences, shape (k, ...), over their places [mm], shape (m, 2), by a Gaussian.

    ``width`` is two of its standard deviations [mm].
    """
    squares = ((places[:, None] - places[None]) ** 2).sum(axis=-1)
    weights = np.exp(-squares / (2 * (width / 2) ** 2))
    square = difference.reshape(len(difference), -1) ** 2 @ (weights / weights.sum(axis=1, keepdims=True)).T
    return np.sqrt(square).reshape(difference.shape)


def _along(coarse: Figures, force: np.ndarray) -> np.ndarray:
    """Return differences of the force [N], shape (k,): their share of it as a root mean square over the neighbours.

    The share is smooth in depth but may cross zero.
    """
    size = np.linalg.norm(force, axis=1)
    square = (np.linalg.norm(coarse.force - force, axis=1) / np.maximum(size, 1e-12)) ** 2
    # States without force have no share: as zeros they would lower their neighbours' error.
    touched = (size > 0).astype(float)
    # Neighbouring depths share their mesh error; a difference at one of them alone may cross zero.
    kernel = np.array([1.0, 2.0, 1.0])
    total = np.convolve(touched, kernel)[1:-1]
    return size * np.sqrt(np.convolve(square * touched, kernel)[1:-1] / np.maximum(total, 1e-12))


def _by_depth(depths: np.ndarray, values: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Interpolate values, shape (k, ...), at depths [mm], shape (n,), linearly from 0 at 0; beyond, in proportion."""
    depths, values = np.concatenate([[0.0], depths[depths > 0]]), values[depths > 0]
    values = np.concatenate([np.zeros_like(values[:1]), values])
    upper = np.clip(np.searchsorted(depths, depth), 1, len(depths) - 1)
    share = np.minimum((depth - depths[upper - 1]) / (depths[upper] - depths[upper - 1]), 1.0)
    beyond = np.maximum(depth / depths[-1], 1.0)
    shape = (-1, *[1] * (values.ndim - 1))
    share, beyond = share.reshape(shape), beyond.reshape(shape)
    return beyond * (values[upper - 1] + share * (values[upper] - values[upper - 1]))
