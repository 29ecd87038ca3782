"""The interpolation error that a path may have, and where states are added to keep it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.errors import UsageError
from tacdata.label_farm.presses.interpolate import Branch, branches

_SHARPEST = 1.2
"""Power of the spacing with which a left-out state's error falls at the least [1]: where the edge of the contact
passes a pixel, its depth has a kink. Elsewhere it is 2 to 3."""

_DENTED = 0.1
"""Share of the nominal depth from which a pixel counts as dented [1]."""

_MOST_PARTS = 4
"""Into how many steps one is split at most."""

_LEAST_STEP = 0.02
"""Step that is not split [mm]."""


@dataclass(frozen=True)
class Tolerance:
    """Largest interpolation error of a state if left out: root mean square over the pixels in contact.

    Not at the worst pixel: where the contact's edge passes, a map goes on by whole elements, and states help little.
    Under a sphere of 3 mm radius, 1 mm deep, a state left out is missed by up to 20.9 um there. A label loses up to
    9.6 um. Twice the states miss 10.6 um (tests/label_farm/presses/test_interpolated_press.py). Of a smooth curve
    they would miss an eighth. That is the mesh's error, which `tacdata.skin.validity.mesh_error` estimates.
    """

    share: float = 0.01
    """Of the depth [1]."""
    least: float = 0.005
    """Tolerance at any depth [mm]."""

    def __post_init__(self) -> None:
        """Refuse tolerances that nothing can meet.

        Raises:
            UsageError: If one is negative or no number.
        """
        if not (0 <= self.share < np.inf and 0 < self.least < np.inf):
            raise UsageError(
                f"a tolerance of {self.share:g} of the depth, at least {self.least:g} mm",
                "a share of 0 or more and a positive least [mm]",
                "correct the tolerance",
            )

    def at(self, depth: np.ndarray) -> np.ndarray:
        """Return the allowed error at depths [mm], as [mm]."""
        return np.maximum(self.least, self.share * depth)

    def refined(self, depth: np.ndarray, surface: np.ndarray) -> tuple[float, ...]:
        """Return the path with states added on both sides of each whose interpolation error is too large.

        Args:
            depth: Depths of the states [mm], shape (k,): rising to the deepest, then falling.
            surface: Maps of these states [mm], shape (k, pixels_x, pixels_y).
        """
        load, unload = (self._split(branch) for branch in branches(depth, surface))
        return (*load, *unload[-2::-1])

    def foretold(self, path: tuple[float, ...], depth: np.ndarray, surface: np.ndarray) -> tuple[float, ...]:
        """Return a path with states added on its way down, where a coarser mesh needs them.

        The way up is described by its difference from the way down.

        Args:
            path: Depths of the states [mm]: rising from 0 to the deepest, then falling.
            depth: Depths that the rougher model reached while loading [mm], shape (k,), some of those of ``path``.
            surface: Its maps [mm], shape (k, pixels_x, pixels_y).
        """
        pressed = depth > 0
        if not pressed.any():
            return path
        depth = np.concatenate([[0.0], depth[pressed]])
        surface = np.concatenate([np.zeros_like(surface[:1]), surface[pressed]])
        split = set(self._split(branches(depth, surface)[0])) - set(depth.tolist())
        result = list(path[:1])
        for upper, lower in pairwise(path):
            result += [*sorted(d for d in split if upper + _LEAST_STEP <= d <= lower - _LEAST_STEP), lower]
        return tuple(result)

    def exceeded(self, depth: np.ndarray, surface: np.ndarray) -> float:
        """Return the largest error of a state over the tolerance [1]; at most 1 where all keep it."""
        return float(max(self._missed(branch).max() for branch in branches(depth, surface)))

    def _missed(self, branch: Branch) -> np.ndarray:
        """Return the error of each state of a branch if left out, over the tolerance there [1], shape (k,)."""
        depth, flat = branch.depth, branch.states
        square = branch.left_out() ** 2
        dented = flat > _DENTED * np.maximum(depth, depth[1])[:, None]
        # A shape between the pixels dents none: then all count.
        dented |= ~dented.any(axis=1, keepdims=True)
        return np.sqrt((square * dented).sum(axis=1) / dented.sum(axis=1)) / self.at(depth)

    def _split(self, branch: Branch) -> list[float]:
        depth, missed = branch.depth, self._missed(branch)
        worst = np.maximum(missed[:-1], missed[1:])
        parts = np.clip(np.ceil(worst ** (1 / _SHARPEST)), 1, _MOST_PARTS).astype(int)
        parts = np.minimum(parts, np.maximum(1, np.floor(np.diff(depth) / _LEAST_STEP + 1e-9)).astype(int))
        depths = [float(depth[0])]
        for low, high, count in zip(depth[:-1], depth[1:], parts, strict=True):
            depths += [round(float(low + (high - low) * k / count), 6) for k in range(1, count)] + [float(high)]
        return depths
