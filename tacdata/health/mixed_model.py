"""Generalized least squares with two relative errors, estimated by restricted maximum likelihood (REML)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

START = (0.01, 0.003)
"""Relative errors that the search begins with: of a channel at a site, and of a site [1]."""
SMALLEST = 1e-4
"""Smallest relative error [1]: presses of a perfect rig would leave none."""
STEP, MOST = 0.05, 80
"""Precision of the logarithms of both errors [1], and evaluations of the likelihood [count]."""


@dataclass(frozen=True)
class SiteRows:
    """The observations at one site: levels of each pressed channel, one channel after the other."""

    design: np.ndarray
    """Contribution of a parameter for each of its units [counts], shape (n, parameters)."""
    response: np.ndarray
    """Measured values [counts], shape (n,)."""
    known: np.ndarray
    """Covariance by noise, time and shift [counts^2], shape (n, n)."""
    own: np.ndarray
    """Covariance of a relative error of each channel, for one of 1 [counts^2], shape (n, n)."""
    shared: np.ndarray
    """Covariance of a relative error of the site, for one of 1 [counts^2], shape (n, n)."""


def solve(rows: Sequence[SiteRows], precision: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the parameters, shape (p,), and their covariance, shape (p, p).

    Args:
        rows: Observations.
        precision: Prior precision of each parameter about 0: one over its variance, shape (p,).
        errors: The two relative errors [1], shape (2,).
    """
    information, score, _ = _sums(rows, precision, errors)
    covariance = np.linalg.pinv(information, hermitian=True)
    return covariance @ score, covariance


def relative_errors(rows: Sequence[SiteRows], precision: np.ndarray) -> np.ndarray:
    """Return the relative errors of a channel at a site, and of a site [1], shape (2,), by REML."""

    def loss(logs: np.ndarray) -> float:
        information, score, residual = _sums(rows, precision, np.maximum(np.exp(logs), SMALLEST))
        fitted = float(score @ np.linalg.pinv(information, hermitian=True) @ score)
        return residual - fitted + float(np.linalg.slogdet(information + 1e-12 * np.eye(len(score)))[1])

    options = {"xatol": STEP, "fatol": STEP, "maxfev": MOST}
    optimum = minimize(loss, np.log(START), method="Nelder-Mead", options=options)
    return np.maximum(np.exp(optimum.x), SMALLEST)


def _sums(rows: Sequence[SiteRows], precision: np.ndarray, errors: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return information, score, and twice the negative restricted log-likelihood but for the fit."""
    information, score, loss = np.diag(precision), np.zeros(len(precision)), 0.0
    for row in rows:
        factor = cho_factor(row.known + errors[0] ** 2 * row.own + errors[1] ** 2 * row.shared, lower=True)
        whitened = cho_solve(factor, np.column_stack([row.design, row.response]))
        information = information + row.design.T @ whitened[:, :-1]
        score = score + row.design.T @ whitened[:, -1]
        loss += 2 * float(np.log(np.diag(factor[0])).sum()) + float(row.response @ whitened[:, -1])
    return information, score, loss
