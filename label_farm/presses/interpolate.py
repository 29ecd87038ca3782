"""Interpolation between the solved states of a path, monotone in depth, with a bound on its error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tacdata.labels import PathSolution


@dataclass(frozen=True)
class Branch:
    """One quantity along one branch of a path, by increasing depth."""

    depth: np.ndarray
    """Depths of the states [mm], shape (k,), from 0, strictly increasing."""
    values: np.ndarray
    """The quantity at these depths [mm or N, as in `PathSolution`], shape (k, m); less that of the way down, if that is
    given."""
    down: Branch | None = None
    """The way down, of a way up: their difference is interpolated, which is small."""

    @property
    def states(self) -> np.ndarray:
        """The quantity at these depths, shape (k, m)."""
        return self.values + self.down.at(self.depth) if self.down else self.values

    @classmethod
    def of(cls, solution: PathSolution, quantity: str, loading: bool) -> Branch:
        """Take a quantity along the loading branch (up to the deepest state) or the unloading branch."""
        down, up = branches(solution.depth, getattr(solution, quantity))
        return down if loading else up

    def at(self, depth: np.ndarray) -> np.ndarray:
        """Return the values at depths [mm], shape (n,), as shape (n, m).

        Piecewise cubic, monotone where the states are: Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980)
        238-246. Held constant beyond the deepest state.
        """
        return self._own(depth) + self.down.at(depth) if self.down else self._own(depth)

    def _own(self, depth: np.ndarray) -> np.ndarray:
        inside = np.clip(depth, 0.0, self.depth[-1])
        k = np.clip(np.searchsorted(self.depth, inside, side="right") - 1, 0, len(self.depth) - 2)
        step, slopes = np.diff(self.depth)[k, None], self._slopes
        t = (inside - self.depth[k])[:, None] / step
        # Hermite's cubic on each interval.
        rest, start, end = 1 - t, self.values[k], self.values[k + 1]
        turn = t * rest * step * (rest * slopes[k] - t * slopes[k + 1])
        return rest**2 * (1 + 2 * t) * start + t**2 * (1 + 2 * rest) * end + turn

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Slopes at the states, shape (k, m): Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304."""
        h = np.diff(self.depth)[:, None]
        chord = np.diff(self.values, axis=0) / h
        if len(chord) == 1:
            return np.repeat(chord, 2, axis=0)
        left, right = chord[:-1], chord[1:]
        near, far = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
        same = left * right > 0
        safe_left, safe_right = np.where(same, left, 1.0), np.where(same, right, 1.0)
        # A weighted harmonic mean: no steeper than the flatter chord lets the curve be monotone.
        inner = np.where(same, (near + far) / (near / safe_left + far / safe_right), 0.0)
        first = _end_slope(h[0], h[1], chord[0], chord[1])
        last = _end_slope(h[-1], h[-2], chord[-1], chord[-2])
        return np.concatenate([first[None], inner, last[None]])

    def left_out(self) -> np.ndarray:
        """Return each state's interpolation error if it were left out, shape (k, m).

        The first and the deepest state, which have neighbours on one side only, take the larger of the two nearest.
        Of a branch without a state between these, all of the change is in doubt.
        """
        inner = range(1, len(self.depth) - 1)
        if not inner:
            return np.repeat(np.abs(self.values[-1:] - self.values[:1]), len(self.depth), axis=0)
        without = [Branch(np.delete(self.depth, k), np.delete(self.values, k, axis=0)) for k in inner]
        missed = [
            np.abs(branch.at(self.depth[[k]])[0] - self.values[k]) for k, branch in zip(inner, without, strict=True)
        ]
        return np.stack([np.max(missed[:2], axis=0), *missed, np.max(missed[-2:], axis=0)])

    def left_out_beside(self, depth: np.ndarray) -> np.ndarray:
        """Return the largest `left_out` of the two states next to each of the depths [mm], shape (n,), as shape (n,).

        On a way up, that of the way down comes on top.
        """
        worst = self.left_out().max(axis=1)
        upper = np.clip(np.searchsorted(self.depth, depth), 1, len(worst) - 1)
        largest = np.maximum(worst[upper - 1], worst[upper])
        return largest + self.down.left_out_beside(depth) if self.down else largest

    def bound(self, depth: np.ndarray) -> np.ndarray:
        """Return a bound on the error of `at` at depths [mm], shape (n,), as shape (n, m).

        Where a quantity bends one way over an interval and its neighbours, it is between the chord and the
        nearer of the two neighbouring chords prolonged into the interval; the bound is the distance of `at`
        from the farther edge of that gap. It is 0 for a path linear in depth, an upper limit on any convex or
        concave stretch, a kink included, and several times the error where the path is smooth. Before contact
        the slope is 0; beyond the deepest state the slope is taken to go on changing as it did, and the part that `at`
        leaves out there is added. On a way up the bounds of the way down and of the difference add up.
        """
        slope = np.diff(self.values, axis=0) / np.diff(self.depth)[:, None]
        last = slope[-1] if len(slope) < 2 else 2 * slope[-1] - slope[-2]
        padded = np.concatenate([np.zeros_like(slope[:1]), slope, last[None]])
        inside = np.clip(depth, 0.0, self.depth[-1])
        i = np.clip(np.searchsorted(self.depth, inside, side="right") - 1, 0, len(slope) - 1)
        way_in, way_out = (inside - self.depth[i])[:, None], (self.depth[i + 1] - inside)[:, None]
        bend = self._own(depth) - self.values[i] - slope[i] * way_in
        from_left, right = (padded[i] - slope[i]) * way_in, (slope[i] - padded[i + 2]) * way_out
        nearer = np.where(np.abs(from_left) < np.abs(right), from_left, right)
        one_way = np.maximum(np.abs(bend), np.abs(nearer - bend))
        within = np.where(from_left * right >= 0, one_way, np.abs(bend) + np.abs(nearer))
        beyond = np.maximum(depth - self.depth[-1], 0.0)[:, None] * np.abs(slope[-1])
        total = within + beyond
        return total + self.down.bound(depth) if self.down else total


def _end_slope(h: np.ndarray, next_h: np.ndarray, chord: np.ndarray, next_chord: np.ndarray) -> np.ndarray:
    """Return slopes at an end of a curve, shape (m,), from its last two intervals and chords: a parabola's, tamed."""
    slope = ((2 * h + next_h) * chord - h * next_chord) / (h + next_h)
    steep = (chord * next_chord < 0) & (np.abs(slope) > 3 * np.abs(chord))
    return np.where(slope * chord <= 0, 0.0, np.where(steep, 3 * chord, slope))


def branches(depth: np.ndarray, values: np.ndarray) -> tuple[Branch, Branch]:
    """Return the ways down and up of a quantity, shape (k, ...), along a path's depths [mm], shape (k,)."""
    peak, flat = int(np.argmax(depth)), values.reshape(len(depth), -1)
    down = Branch(depth[: peak + 1], flat[: peak + 1])
    at = depth[peak:][::-1]
    return down, Branch(at, flat[peak:][::-1] - down.at(at), down)
