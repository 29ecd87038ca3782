"""The gap between model and measurement, before and after, on episodes that were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.discrepancy.search.gauss_newton import Refined
from tacdata.effects import Placed
from tacdata.revision.comparison import LEAST_WHITE, Comparison
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
    """Mean square of the residual over the noise [1]; 1 is noise alone."""
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

    total: ResidualChange
    """Gap of the sealed episodes."""
    interval: tuple[float, float]
    """90 % bootstrap interval of the share closed, over sealed episodes [1]."""
    unseen: bool
    """Whether the verdict itself was reached without the sealed episodes."""
    predicted: bool
    """Whether the response was fitted without their readings; not where no other episode has their place."""
    worst: ResidualChange
    """The sealed episode with the largest gap after."""
    elsewhere: tuple[ResidualChange, ...]
    """Groups that the effects' parameters were not fitted to: another rate, depth, indenter."""
    before: Refined
    """The model without the effects."""
    after: Refined
    """The model with them, its parameters fitted without the sealed episodes."""
    scale: np.ndarray
    """Noise of a reading [the source's unit], shape (channels,)."""


def gap(
    comparison: Comparison,
    placed: Sequence[Placed],
    sealed: Sealed,
    scale: np.ndarray,
    note: Callable[[str], None] = lambda text: None,
) -> GapReduction:
    """Measure the gap on the verdict's scale: mean squares over the noise, each episode's median subtracted.

    Args:
        comparison: Recordings and the model before.
        placed: The effects to add.
        sealed: Episodes that the effects' parameters are not fitted to.
        scale: Noise of a reading [the source's unit], shape (channels,).
        note: Called with a line for each group that is left out.
    """
    numbers = sealed.numbers
    predicted = comparison.covered(numbers)
    response_base = comparison.without(numbers) if predicted else comparison
    fitted = tuple(placed) if sealed.unseen else comparison.fitted_without(placed, numbers)
    initial, revised = response_base.before, response_base.after(fitted)
    pair = np.array([comparison.mean_squares(model, numbers, scale) for model in (initial, revised)])
    # The worst after, as the effects must not trade one episode for another.
    at = int(np.argmax(pair[1]))
    total = ResidualChange("sealed episodes", len(numbers), *(float(v) for v in pair.mean(axis=1)))
    worst = ResidualChange(comparison.course.names[numbers[at]], 1, *(float(v) for v in pair[:, at]))
    elsewhere = []
    for name, group in groups(comparison.course):
        note(f"gap, fitted without: {name}")
        held_out = comparison.after(comparison.fitted_without(placed, group))
        sizes = (float(comparison.mean_squares(model, group, scale).mean()) for model in (comparison.before, held_out))
        elsewhere.append(ResidualChange(name, len(group), *sizes))
    return GapReduction(
        total, _interval(pair), sealed.unseen, predicted, worst, tuple(elsewhere), initial, revised, scale
    )


def noise_of(verdict: dict[str, Any], comparison: Comparison) -> np.ndarray:
    """Return the noise by which the verdict divides residuals [the source's unit], shape (channels,).

    Args:
        verdict: The verdict's document.
        comparison: Recordings and model; their own noise is used if the verdict states none for these channels.
    """
    stated = verdict.get("gate", {})
    scale, memory = np.array(stated.get("noise", ()), dtype=float), float(stated.get("memory", 0.0))
    channels = comparison.course.channels
    if len(scale) < channels or not (scale[:channels] > 0).all():
        return comparison.noise
    return scale[:channels] / np.sqrt(max(1 - memory**2, LEAST_WHITE))


def _interval(pair: np.ndarray) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    # The same episodes for both models: their differences count, not their scatter.
    draws = rng.integers(0, pair.shape[1], (DRAWS, pair.shape[1]))
    first, last = (values[draws].mean(axis=1) for values in pair)
    closed = (first - last) / np.where(np.abs(first - 1) > 1e-3, first - 1, np.nan)
    if not np.isfinite(closed).any():
        return float("nan"), float("nan")
    low, high = np.nanquantile(closed, [0.05, 0.95])
    return float(low), float(high)
