"""The remainder: an answer's residual as a discrepancy term, orthogonal to the named effects.

The residual is taken as a Gaussian process with a linear kernel: patterns of the streams times histories of the path
(depth, rate, memory, direction) with weights N(0, tau^2). The tangent space of the named effects' parameters is
projected out first, so neither absorbs a part of the other (Plumlee, J. Am. Stat. Assoc. 112, 2017, 1274). tau is
estimated by restricted maximum likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import eliminated

SIZES = np.geomspace(1e-3, 1e4, 71)
"""Root of the largest column's information, times tau, that are tried [1]."""


@dataclass(frozen=True)
class Remainder:
    """A discrepancy term at one standard deviation of its prior."""

    columns: np.ndarray
    """Whitened [1], shape (m, streams, k), float32; k is 0 where nothing is left."""
    size: float
    """tau, the prior's standard deviation [1]."""


def remainder(final: Problem) -> Remainder:
    """Return the remainder of a model with its answer in place."""
    gram = eliminated(final.grams.gram, final.fixed, final.fixed_ridge(0.0))
    total, index = gram.sum(axis=0), final.generic + 1
    size = _size(total[np.ix_(index, index)], total[index, 0], float(total[0, 0]), float(final.grams.rows.sum()))
    generic = final.null.beside[:, :, len(final.null.ridge) :]
    columns = generic * np.float32(size) if size > 0 else generic[:, :, :0]
    return Remainder(columns, size)


def _size(information: np.ndarray, score: np.ndarray, square: float, values: float) -> float:
    """Return tau by restricted maximum likelihood; 0 where the residual is noise.

    Args:
        information: Of the columns, shape (k, k).
        score: Their products with the residual, shape (k,).
        square: The residual's sum of squares.
        values: Values behind it.
    """
    power, axes = np.linalg.eigh(information)
    good = power > 1e-9 * max(float(power[-1]), 1e-300)
    power, projection = power[good], axes[:, good].T @ score
    explained = np.square(projection) / power
    noise = max((square - float(explained.sum())) / max(values - len(power), 1.0), 1.0)
    best, best_size = 0.0, 0.0
    # By a grid: the likelihood of a variance may have its maximum at zero, where gradients mislead.
    for root in SIZES:
        grown = root**2 * power / power[-1]
        fit = 0.5 * float(np.sum(explained * grown / (1 + grown))) / noise - 0.5 * float(np.log1p(grown).sum())
        if fit > best:
            best, best_size = fit, float(root / np.sqrt(power[-1]))
    return best_size
