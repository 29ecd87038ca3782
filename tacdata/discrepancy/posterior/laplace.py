"""The evidence of a set of effects at its optimum: Laplace's approximation, the remainder's size integrated out.

About the optimum the log-likelihood is a quadratic form in the Gram matrices. Numbers of the set, form errors,
numerics and nuisances have normal priors there and are integrated out. The remainder is a Gaussian process with a
linear kernel (patterns of the streams times histories of the path), of one of several sizes.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import erfcx, ndtr

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.policy import Policy
from tacdata.discrepancy.posterior.priors import NumberPrior

JITTERS = (1e-6, 1e-5, 1e-3)
"""Added to a unit diagonal, until a matrix of single precision is positive [1]."""
TURNS = 4
"""Rounds in which numbers that would leave their bounds are held there."""


def log_evidence(model: Optimum, counts: np.ndarray, largest: float, policy: Policy) -> np.ndarray:
    """Return the logarithm of a set's evidence, shape (samples, sizes of the remainder).

    Amplitudes that each channel has of its own share a width, which is summed over.

    Args:
        model: The set at its optimum.
        counts: How often each press is drawn, shape (samples, presses).
        largest: Largest information of a remainder's column, in the model without effects [1].
        policy: With the priors.
    """
    scales = policy.scales if any(knob.channel is not None for knob in model.knobs) else (1.0,)
    each = np.stack([_of_width(model, counts, largest, policy, scale) for scale in scales])
    return np.logaddexp.reduce(each, axis=0) - float(np.log(len(scales)))


def _of_width(model: Optimum, counts: np.ndarray, largest: float, policy: Policy, scale: float) -> np.ndarray:
    """Return the logarithm of the evidence given the width of amplitudes that each channel has of its own."""
    knobs, forms, numerics, nuisances, rest = model.counts
    prior = NumberPrior.of(model.knobs, model.placed, policy, scale)
    beside = knobs + forms + numerics + nuisances
    others = np.concatenate(
        [np.full(forms, 1 / policy.forms**2), np.full(numerics, 1 / policy.numerics**2), model.ridge]
    )
    precision = np.concatenate([prior.precision, others])
    constant = prior.log + 0.5 * float(np.log(np.maximum(others, 1e-12)).sum()) - 0.5 * model.freedom
    columns, remainder = np.arange(1, beside + 1), np.arange(beside + 1, beside + 1 + rest)
    result = np.empty((len(counts), len(policy.sizes)))
    for sample, weights in enumerate(counts):
        gram = np.tensordot(weights, model.gram, axes=1)
        slope, matrix = gram[columns, 0].copy(), gram[np.ix_(columns, columns)]
        slope[:knobs] += prior.slope
        matrix[np.diag_indices_from(matrix)] += precision
        held, moved = _held(matrix, slope, model.rooms)
        edge = float(slope[held] @ moved - 0.5 * moved @ matrix[np.ix_(held, held)] @ moved)
        free = np.setdiff1d(np.arange(beside), held)
        factor, spread = _factor(matrix[np.ix_(free, free)])
        target = slope[free] - matrix[np.ix_(free, held)] @ moved
        right = np.concatenate([target[:, None], gram[np.ix_(free + 1, remainder)]], axis=1)
        moving = np.flatnonzero(free < knobs)
        units = np.zeros((len(free), len(moving)))
        units[moving, np.arange(len(moving))] = 1.0
        both = solve_triangular(factor, np.concatenate([right, units], axis=1) / spread[:, None], lower=True)
        solved, units = both[:, : right.shape[1]], both[:, right.shape[1] :]
        spreads = np.sqrt(np.square(units).sum(axis=0))
        edge += _log_inside(units.T @ solved[:, 0], spreads, model.rooms[free[moving]])
        if len(held):
            inside = solve_triangular(factor, solved[:, 0], lower=True, trans="T") / spread
            outward = slope[held] - matrix[np.ix_(held, held)] @ moved - matrix[np.ix_(held, free)] @ inside
            edge += _log_beyond(np.abs(outward), np.diag(matrix)[held])
        fixed = constant + edge - 0.5 * gram[0, 0] + 0.5 * float(solved[:, 0] @ solved[:, 0])
        fixed -= float(np.log(np.diag(factor) * spread).sum())
        information = gram[np.ix_(remainder, remainder)] - solved[:, 1:].T @ solved[:, 1:]
        score = gram[remainder, 0] - gram[np.ix_(remainder, held + 1)] @ moved - solved[:, 1:].T @ solved[:, 0]
        result[sample] = fixed + _remainder(information, score, largest, policy)
    return result


def _factor(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a Cholesky factor of a matrix scaled to a unit diagonal, and the scale.

    Columns are of single precision: so much is added that directions without information stay positive.
    """
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    even = matrix / np.outer(scale, scale)
    even = 0.5 * (even + even.T)
    for jitter in JITTERS:
        try:
            return np.linalg.cholesky(even + jitter * np.eye(len(even))), scale
        except np.linalg.LinAlgError:
            continue
    power, axes = np.linalg.eigh(even)
    root = axes * np.sqrt(np.maximum(power, JITTERS[-1]))
    return np.linalg.cholesky(root @ root.T + JITTERS[-1] * np.eye(len(even))), scale


def _held(matrix: np.ndarray, slope: np.ndarray, rooms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which numbers would leave their bounds, shape (h,), int64, and how far they move to these, shape (h,)."""
    held: dict[int, float] = {}
    for _ in range(TURNS):
        at, to = np.array(sorted(held), dtype=int), np.array([held[k] for k in sorted(held)])
        free = np.setdiff1d(np.arange(len(slope)), at)
        factor, scale = _factor(matrix[np.ix_(free, free)])
        target = (slope[free] - matrix[np.ix_(free, at)] @ to) / scale
        half = solve_triangular(factor, target, lower=True)
        step = solve_triangular(factor, half, lower=True, trans="T") / scale
        fresh = {
            int(k): float(np.clip(by, *rooms[k]))
            for k, by in zip(free, step, strict=True)
            if k < len(rooms) and not rooms[k, 0] <= by <= rooms[k, 1]
        }
        if not fresh:
            return at, to
        held |= fresh
    at = np.array(sorted(held), dtype=int)
    return at, np.array([held[k] for k in at])


def _log_inside(values: np.ndarray, spreads: np.ndarray, rooms: np.ndarray) -> float:
    """Return the logarithm of the share of a normal density that lies inside bounds, each number by itself [1]."""
    if not len(values):
        return 0.0
    low, high = ((rooms[:, k] - values) / np.maximum(spreads, 1e-12) for k in (0, 1))
    return float(np.log(np.maximum(ndtr(high) - ndtr(low), 1e-12)).sum())


def _log_beyond(slope: np.ndarray, precision: np.ndarray) -> float:
    """Return the logarithm of the integral of a density from its bound inwards, over the root of 2 pi [1].

    Args:
        slope: By which its logarithm falls inwards [1 / step].
        precision: By which it bends [1 / step^2].
    """
    root = np.sqrt(np.maximum(precision, 1e-12))
    return float(np.log(np.maximum(0.5 / root * erfcx(slope / (np.sqrt(2.0) * root)), 1e-300)).sum())


def _remainder(information: np.ndarray, score: np.ndarray, largest: float, policy: Policy) -> np.ndarray:
    """Return what a remainder of each size adds to the log-evidence, its prior included, shape (sizes,)."""
    power, axes = np.linalg.eigh(information)
    power = np.maximum(power, 0.0)
    turned = np.square(axes.T @ score)
    made = []
    for size, share in zip(policy.sizes, size_prior(policy), strict=True):
        variance = size**2 / largest
        gain = 0.5 * float(np.sum(turned * variance / (1 + variance * power)))
        made.append(gain - 0.5 * float(np.log1p(variance * power).sum()) + float(np.log(share)))
    return np.array(made)


def size_prior(policy: Policy) -> np.ndarray:
    """Return the prior probability of each size of the remainder, shape (sizes,)."""
    none = np.asarray(policy.sizes) == 0
    return np.where(none, policy.quiet, (1 - policy.quiet) / max(np.count_nonzero(~none), 1))


def largest_information(empty: Optimum) -> float:
    """Return the largest information of a remainder's column [1]."""
    rest = empty.counts[4]
    total = empty.gram.sum(axis=0)
    return max(float(np.diag(total)[-rest:].max(initial=0.0)) if rest else 0.0, 1e-9)
