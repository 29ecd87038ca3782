"""Loads of a press at its real speed, from a path solved slowly: linear viscoelastic contact after the solve.

The skin model's paths are those of slow presses. If the whole stress relaxed by one function psi(t) = G(t)/G_inf, then
in displacement control, without friction, the elastic solution would carry over (Lee and Radok, J. Appl. Mech. 27
(1960) 438; for contacts that shrink again Ting, J. Appl. Mech. 33 (1966) 845):

    F(t) = int_0^t1 psi(t - s) dF_el(depth(s)),

t1 = t while the depth rises or holds; on the way back the earlier moment at which the contact was as large as now,

    int_t1^t psi(t - s) d depth(s) = 0,

and no load once there is none. The deformed face is that of the slow path at the depth of t1.

What is assumed, and what it costs: the part of the stress that carries volume changes does not relax (`prony.py`), so
that a sudden press is stiffer by less than G0/G_inf. The true factor is that of two elastic solutions, one with the
instantaneous shear modulus and the same bulk modulus: `instantaneous` gives the material, ``stiffening`` takes the
factor. What is left is measured in `tests/skin/test_skin_relaxed_loads.py`. Friction's own path is taken as that of
loading. Ting's rule is exact on a half-space under a round shape; for protrusions on a board it is a rule of thumb.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from tacdata.errors import UsageError
from tacdata.labels import PathSolution
from tacdata.sensor import Material
from tacdata.skin.constitutive.prony import Prony


@dataclass(frozen=True)
class RelaxedLoads:
    """Loads at n times."""

    force: np.ndarray
    """Force of the skin on the indenter [N], shape (n, 3)."""
    taxel_force: np.ndarray
    """Normal force on each protrusion [N], shape (n, taxels)."""
    contact_depth: np.ndarray
    """Depth of the slow path whose contact and deformed face are those of each time [mm], shape (n,)."""


def instantaneous(material: Material) -> Material:
    """Return the elastic material of a sudden press: shear modulus G0, the same bulk modulus, nothing left to relax."""
    shear = material.shear_modulus * Prony.of(material).instantaneous_ratio
    bulk = material.bulk_modulus
    nu = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
    return replace(material, youngs_modulus=2 * shear * (1 + nu), poisson_ratio=nu, prony=())


def relaxed_loads(
    time: np.ndarray, depth: np.ndarray, path: PathSolution, prony: Prony, stiffening: float | None = None
) -> RelaxedLoads:
    """Return the loads of a press along its real course.

    Args:
        time: Rising times [s], shape (n,); the skin has rested before the first.
        depth: Depths of the indenter [mm], shape (n,), linear between the times: one rise, holds, one fall. Below 0:
            no contact.
        path: The press, solved slowly to at least the greatest depth; its loading branch is used.
        prony: The relaxation.
        stiffening: Load of a sudden press over that of a slow one [1]; None: G0/G_inf, if volume changes relaxed too.

    Raises:
        UsageError: If times do not rise, the depth falls and rises again, or goes deeper than the path.
    """
    time, depth = np.asarray(time, dtype=float), np.maximum(np.asarray(depth, dtype=float), 0.0)
    _check(time, depth, path)
    top = int(path.depth.argmax()) + 1
    depths, first = np.unique(path.depth[:top], return_index=True)
    loads = np.concatenate([path.force[first], path.taxel_force[first]], axis=1)
    if depths[0] > 0:
        depths, loads = np.concatenate([[0.0], depths]), np.vstack([np.zeros(loads.shape[1]), loads])
    elastic = PchipInterpolator(depths, loads)
    scale = 1.0
    if stiffening is not None and prony.shares:
        scale = (stiffening - 1) / (prony.instantaneous_ratio - 1)
    kernel = _Kernel(prony, scale)
    # Loads are taken as linear between these depths, so that a course of few corners is refined.
    fine = _refined(time, depth)
    course = np.interp(fine, time, depth)
    found, contact = np.empty((len(time), loads.shape[1])), np.empty(len(time))
    for k, now in enumerate(time):
        last = int(np.searchsorted(fine, now))
        start = _as_large(kernel, fine[: last + 1], course[: last + 1])
        found[k] = kernel.weights(now, start) @ np.diff(elastic(np.interp(start, fine, course)), axis=0)
        contact[k] = np.interp(start[-1], fine, course)
    return RelaxedLoads(found[:, :3], found[:, 3:], contact)


class _Kernel:
    """psi(t) = 1 + scale (G(t)/G_inf - 1), averaged over segments of time."""

    def __init__(self, prony: Prony, scale: float) -> None:
        self._strength, self._time = scale * np.array(prony.strengths), np.array(prony.times)

    def weights(self, now: float, times: np.ndarray) -> np.ndarray:
        """Return the mean of psi(now - s) over each segment between ``times`` [s], shape (len(times) - 1,)."""
        ages, length = (now - times)[:, None], np.maximum(np.diff(times), 1e-15)[:, None]
        decayed = np.diff(np.exp(-np.maximum(ages, 0.0) / self._time), axis=0) * self._time / length
        return 1 + (self._strength * decayed).sum(axis=1)


def _as_large(kernel: _Kernel, times: np.ndarray, course: np.ndarray) -> np.ndarray:
    """Return the times up to t1, when the contact was as large as at the last of ``times``."""
    if len(times) < 2 or course[-1] >= course.max():
        return times
    moved = kernel.weights(times[-1], times) * np.diff(course)
    back = np.cumsum(moved[::-1])[::-1]
    # back[m] is the integral from times[m] on: below 0 just before the end, above where the rise outweighs the fall.
    above = np.flatnonzero(back >= 0)
    if not len(above):
        return times[:1]
    m = int(above[-1])
    below = back[m + 1] if m + 1 < len(back) else 0.0
    share = float(np.clip(back[m] / (back[m] - below), 0.0, 1.0)) if back[m] > below else 1.0
    return np.append(times[: m + 1], times[m] + share * (times[m + 1] - times[m]))


def _refined(time: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return the times and those between them at steps of a hundredth of the greatest depth."""
    step = max(float(depth.max()) / 100, 1e-12)
    parts = np.maximum(np.ceil(np.abs(np.diff(depth)) / step).astype(int), 1)
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(time[:-1], time[1:], parts, strict=True)]
    return np.concatenate([*pieces, time[-1:]])


def _check(time: np.ndarray, depth: np.ndarray, path: PathSolution) -> None:
    if len(time) != len(depth) or len(time) < 1 or not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0):
        raise UsageError(
            f"{len(time)} times and {len(depth)} depths", "as many finite, rising times as depths",
            "take the press's course from one episode",
        )
    moves = np.sign(np.diff(depth))
    moves = moves[moves != 0]
    if np.any(np.diff(moves) > 0):
        raise UsageError(
            "a course that falls and rises again", "one rise, holds and one fall", "cut the course at its releases"
        )
    if depth.max() > path.depth.max() + 1e-9:
        raise UsageError(
            f"a course {depth.max():g} mm deep", f"at most the path's {path.depth.max():g} mm", "solve the press deeper"
        )
