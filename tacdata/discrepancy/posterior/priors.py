"""Priors: over sets of mechanisms, over their forms, and over the numbers of each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, ndtr
from scipy.stats import t as student

from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.regressors.tangent import Knob
from tacdata.effects import Effect, Parameter, Placed

LEAST_SPREAD = 0.5
"""Prior of a shape with one value on its grid: standard deviation [e-folds]."""


@dataclass(frozen=True)
class SetPrior:
    """Prior probability of a set of effects, over that of the empty set."""

    logs: dict[str, float]
    """Effect -> logarithm of its prior odds."""

    @classmethod
    def of(cls, effects: Iterable[Effect], policy: Policy) -> SetPrior:
        """Return the prior: mechanisms share the mean number of effects by their odds, forms share their mechanism's.

        Args:
            effects: Those that these recordings may show.
            policy: With the mean number of effects.
        """
        forms: dict[str, dict[str, Effect]] = {}
        for effect in effects:
            forms.setdefault(effect.called, {})[effect.name] = effect
        odds = {called: max(e.odds for e in own.values()) for called, own in forms.items()}
        whole = max(sum(odds.values()), 1e-12)
        return cls(
            {
                name: float(np.log(policy.effects * odds[called] / whole / len(own)))
                for called, own in forms.items()
                for name in own
            }
        )

    def of_set(self, effects: Iterable[Effect]) -> float:
        """Return the logarithm of a set's prior odds; -inf with an effect that cannot be judged."""
        return sum(self.logs.get(e.name, -np.inf) for e in effects)


@dataclass(frozen=True)
class NumberPrior:
    """Prior of the numbers of a set, to second order about their values."""

    log: float
    """Logarithm of its density, times (2 pi)^(k/2) [1]."""
    slope: np.ndarray
    """Derivative of that logarithm by each number [1 / step], shape (k,)."""
    precision: np.ndarray
    """Its precision [1 / step^2], shape (k,)."""

    @classmethod
    def of(cls, knobs: Sequence[Knob], placed: Sequence[Placed], policy: Policy, scale: float = 1.0) -> NumberPrior:
        """Return the prior about values.

        An amplitude has a t distribution, as wide as its typical size, inside its physical bounds. Amplitudes that each
        channel has of its own are normal with one width. A shape's logarithm is normal about the middle of its grid.

        Args:
            knobs: The numbers.
            placed: Effects with values.
            policy: With the degrees of freedom.
            scale: Width of amplitudes that each channel has of its own [typical sizes].
        """
        log, slope, precision = 0.0, np.zeros(len(knobs)), np.ones(len(knobs))
        for k, knob in enumerate(knobs):
            p, value = knob.parameter, knob.value(placed)
            if knob.shape:
                middle, spread = shape_prior(p)
                off = float(np.log(max(value, 1e-300))) - middle
                slope[k], precision[k] = -off / spread**2, 1 / spread**2
                log += -0.5 * (off / spread) ** 2 - float(np.log(spread))
                continue
            size = (value - p.default) / p.typical
            if knob.channel is not None:
                slope[k], precision[k] = -size / scale**2, 1 / scale**2
                log += -0.5 * (size / scale) ** 2 - float(np.log(scale * _inside(p, np.inf, scale)))
                continue
            nu = policy.freedom
            precision[k] = (nu + 1) / (nu + size**2)
            slope[k] = -precision[k] * size
            log += _t_log(size, nu) - float(np.log(_inside(p, nu, 1.0)))
        return cls(log, slope, precision)


def _t_log(size: float, nu: float) -> float:
    """Return the logarithm of a t density, times the root of 2 pi."""
    norm = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu / 2)
    return float(norm - 0.5 * (nu + 1) * np.log1p(size**2 / nu))


def _inside(p: Parameter, nu: float, width: float) -> float:
    """Return the probability that an amplitude lies inside its bounds."""
    low, high = ((bound - p.default) / (p.typical * width) for bound in (p.low, p.high))
    share = student.cdf(high, nu) - student.cdf(low, nu) if np.isfinite(nu) else ndtr(high) - ndtr(low)
    return max(float(share), 1e-6)


def shape_prior(p: Parameter) -> tuple[float, float]:
    """Return the middle and the standard deviation of the logarithm of a shape."""
    grid = np.log(np.asarray(p.grid, dtype=float))
    return 0.5 * float(grid.min() + grid.max()), max(0.5 * float(np.ptp(grid)), LEAST_SPREAD)
