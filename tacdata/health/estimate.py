"""A value with its standard error and degrees of freedom: intervals, tests against a tolerance, Holm's correction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

COVERED = 0.95
"""Probability that an interval covers the value [1]."""


@dataclass(frozen=True)
class UncertainValue:
    """An estimate, normal about its value."""

    value: float
    error: float
    """Standard error, in the value's unit."""
    freedom: float
    """Degrees of freedom of the error [1]."""

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds that cover the value with `COVERED`."""
        half = float(stats.t.ppf(0.5 + COVERED / 2, self.freedom)) * self.error
        return self.value - half, self.value + half

    def p_beyond(self, tolerance: float) -> float:
        """Return the p-value of "it is within ± the tolerance" (minimum-effect test)."""
        if not np.isfinite(self.value):
            return 1.0
        return float(min(2 * stats.t.sf((abs(self.value) - tolerance) / max(self.error, 1e-12), self.freedom), 1.0))


@dataclass(frozen=True)
class Spread:
    """A standard deviation estimated from normal numbers."""

    value: float
    freedom: float
    """Degrees of freedom [1]."""

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds that cover the standard deviation with `COVERED` (chi-squared)."""
        high, low = stats.chi2.ppf([0.5 - COVERED / 2, 0.5 + COVERED / 2], self.freedom)
        return self.value * float(np.sqrt(self.freedom / low)), self.value * float(np.sqrt(self.freedom / high))

    def p_above(self, limit: float) -> float:
        """Return the p-value of "it is at most the limit" (chi-squared)."""
        return float(stats.chi2.sf(self.freedom * (self.value / limit) ** 2, self.freedom))

    def p_louder(self, earlier: Spread, factor: float) -> float:
        """Return the p-value of "its ratio to the value before is at most the tolerance" (F test)."""
        ratio = (self.value / max(earlier.value * factor, 1e-12)) ** 2
        return float(stats.f.sf(ratio, self.freedom, earlier.freedom))


def mean(values: np.ndarray) -> UncertainValue:
    """Return the mean of independent values, shape (n,), with its standard error; NaN from fewer than two."""
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return UncertainValue(float(finite.mean()) if len(finite) else float("nan"), float("nan"), 1.0)
    return UncertainValue(float(finite.mean()), float(finite.std(ddof=1) / np.sqrt(len(finite))), len(finite) - 1.0)


def holm(p_values: Sequence[float]) -> np.ndarray:
    """Return p-values corrected for all tests, shape (n,): Holm's step-down method."""
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return corrected
