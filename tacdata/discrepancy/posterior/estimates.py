"""Estimates: numbers of a set with standard errors and intervals.

A number's error is the larger of two. Laplace's: the inverse of the Hessian at the optimum, nuisances and the remainder
integrated out. The jackknife's, over the samples of presses that the posterior is averaged over (Shao & Wu, Annals of
Statistics 17, 1989, 1176): it holds where readings of one press err together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.laplace import largest_information
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.priors import NumberPrior

Z90 = 1.645
"""Standard errors of a 90 % interval [1]."""


@dataclass(frozen=True)
class Estimate:
    """One parameter of an effect."""

    value: np.ndarray
    """Its value, or one of each channel [its unit], shape () or (channels,)."""
    error: np.ndarray
    """Its standard error [its unit], the same shape."""
    interval: tuple[np.ndarray, np.ndarray]
    """90 % interval inside physical bounds [its unit]; each of the same shape."""
    unit: str
    at_bound: bool
    """Whether a value is at a physical bound."""


def estimates(
    model: Optimum, empty: Optimum, counts: np.ndarray, size: float, policy: Policy
) -> tuple[Mapping[str, Estimate], ...]:
    """Return the estimates of each effect of a set.

    Args:
        model: The set at its optimum.
        empty: The set without effects, which gives the remainder its scale.
        counts: How often each press is drawn: all presses first, then samples of them, shape (1 + samples, presses).
        size: Size of the remainder beside the set [root of the largest information].
        policy: With the priors.
    """
    if not model.placed:
        return ()
    knobs = len(model.knobs)
    prior = NumberPrior.of(model.knobs, model.placed, policy)
    variance = size**2 / largest_information(empty)
    moves, covariance = [], np.zeros((knobs, knobs))
    for number, weights in enumerate(counts):
        slope, inverse = _marginal(model, np.tensordot(weights, model.gram, axes=1), prior, variance, policy)
        moves.append(np.clip(inverse @ slope, model.rooms[:, 0], model.rooms[:, 1]))
        if number == 0:
            covariance = inverse
    square = np.maximum(np.diag(covariance), 0.0)
    if len(moves) > 2:
        kept = float(np.mean([c.sum() for c in counts[1:]]) / max(counts[0].sum(), 1e-9))
        scatter = np.var(np.array(moves[1:]), axis=0) * kept / max(1 - kept, 1e-3)
        square = np.maximum(square, scatter)
    return _of_effects(model, np.sqrt(square))


def _marginal(
    model: Optimum, gram: np.ndarray, prior: NumberPrior, variance: float, policy: Policy
) -> tuple[np.ndarray, np.ndarray]:
    """Return slope and covariance of a set's numbers with all that is beside them integrated out."""
    knobs, forms, numerics, _, rest = model.counts
    precision = np.concatenate(
        [
            np.full(forms, 1 / policy.forms**2),
            np.full(numerics, 1 / policy.numerics**2),
            np.maximum(model.ridge, 1e-12),
            np.full(rest if variance > 0 else 0, 1 / max(variance, 1e-300)),
        ]
    )
    own = np.arange(1, knobs + 1)
    others = np.arange(knobs + 1, knobs + 1 + len(precision))
    beside = gram[np.ix_(others, others)] + np.diag(precision)
    through = np.linalg.solve(beside, gram[np.ix_(others, np.append(own, 0))])
    both = gram[np.ix_(own, others)] @ through
    matrix = gram[np.ix_(own, own)] - both[:, :-1] + np.diag(prior.precision)
    slope = gram[own, 0] - both[:, -1] + prior.slope
    return slope, np.linalg.pinv(0.5 * (matrix + matrix.T), hermitian=True)


def _of_effects(model: Optimum, error: np.ndarray) -> tuple[Mapping[str, Estimate], ...]:
    """Return the estimates, in the units of the parameters."""
    made: list[dict[str, Estimate]] = []
    for at, one in enumerate(model.placed):
        own: dict[str, Estimate] = {}
        for p in one.effect.parameters:
            index = [k for k, knob in enumerate(model.knobs) if knob.at == at and knob.parameter.name == p.name]
            value = np.asarray(one.values[p.name], dtype=float)
            by = error[index].reshape(value.shape) if index else np.zeros_like(value)
            if p.grid:
                size, ends = by * np.abs(value), (value * np.exp(-Z90 * by), value * np.exp(Z90 * by))
            else:
                size = by * p.typical
                ends = (value - Z90 * size, value + Z90 * size)
            low, high = np.clip(ends[0], p.low, p.high), np.clip(ends[1], p.low, p.high)
            own[p.name] = Estimate(value, size, (low, high), p.unit, _at_bound(value, p.low, p.high, p.default))
        made.append(own)
    return tuple(made)


def _at_bound(value: np.ndarray, low: float, high: float, default: float) -> bool:
    """Return whether a value is at a bound that is none of an effect of size zero."""
    top = bool(np.any(value >= high - 0.001 * abs(high)))
    return top or (low < default and bool(np.any(value <= low + 0.001 * abs(low))))
