"""The gap between model and measurement, before and after, on episodes that were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.effects import Placed
from tacdata.revision.comparison import Comparison
from tacdata.revision.episodes import Sealed, groups

DRAWS = 2000
"""Bootstrap resamples of the episodes for an interval."""


@dataclass(frozen=True)
class ResidualChange:
    """Mean squares of one set of episodes, before and after."""

    name: str
    episodes: int
    """Number of episodes."""
    before: float
    """Mean square of the whitened residual [1]; 1 is the noise floor."""
    after: float
    """The same with the effects."""

    @property
    def closed(self) -> float:
        """Share of the mean square above the noise floor that is gone [1]; NaN where there was none."""
        above = self.before - 1.0
        return (self.before - self.after) / above if above > 1e-3 else float("nan")


@dataclass(frozen=True)
class GapReduction:
    """How much smaller the gap is, overall and by group."""

    whole: ResidualChange
    """Gap of the sealed episodes."""
    interval: tuple[float, float]
    """90 % bootstrap interval of the share closed, over sealed episodes [1]."""
    unseen: bool
    """Whether the verdict itself was reached without the sealed episodes."""
    worst: ResidualChange
    """The sealed episode with the largest gap after."""
    elsewhere: tuple[ResidualChange, ...]
    """Groups that the effects' parameters were not fitted to: another rate, depth, indenter."""
    fitted: tuple[Placed, ...]
    """The effects with parameters fitted without the sealed episodes."""


def gap(
    held: Comparison, placed: Sequence[Placed], chosen: Sealed, note: Callable[[str], None] = lambda text: None
) -> GapReduction:
    """Measure the gap.

    Args:
        held: Recordings and the model before.
        placed: The effects to add.
        chosen: Episodes that the effects' parameters are not fitted to.
        note: Called with a line for each group that is left out.
    """
    numbers = chosen.numbers
    fitted = held.fitted_without(placed, numbers)
    before, after = held.before, held.after(fitted)
    whole = ResidualChange(
        "sealed episodes", len(numbers), held.mean_square(before, numbers), held.mean_square(after, numbers)
    )
    ratio = [2 * after.energy[n] / held.values[n] for n in numbers]
    at = int(numbers[int(np.argmax(ratio))])
    worst = ResidualChange(
        held.course.names[at], 1, held.mean_square(before, np.array([at])), held.mean_square(after, np.array([at]))
    )
    elsewhere = []
    for name, own in groups(held.course):
        note(f"gap, fitted without: {name}")
        there = held.after(held.fitted_without(placed, own))
        elsewhere.append(ResidualChange(name, len(own), held.mean_square(before, own), held.mean_square(there, own)))
    pair = np.array([before.energy[numbers], after.energy[numbers]])
    return GapReduction(whole, _interval(pair, held.values[numbers]), chosen.unseen, worst, tuple(elsewhere), fitted)


def _interval(energy: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    draws = rng.integers(0, len(values), (DRAWS, len(values)))
    first, last = (2 * e[draws].sum(axis=1) / values[draws].sum(axis=1) for e in energy)
    closed = (first - last) / np.where(np.abs(first - 1) > 1e-3, first - 1, np.nan)
    if not np.isfinite(closed).any():
        return float("nan"), float("nan")
    low, high = np.nanquantile(closed, [0.05, 0.95])
    return float(low), float(high)
