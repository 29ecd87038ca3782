"""Finds the centre of a taxel's answer along a line, by a symmetric bell B + A (1 + ((s - c) / w)^2)^-q.

The exponent q is free, from Gaussian-like to Boussinesq's spreading of stress under a slab (K. L. Johnson, Contact
Mechanics, eq. 2.22: q = 5/2). Only the centre is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

FLOOR = 0.005
"""Smallest uncertainty that is stated [mm]."""
CLEAR = 6.0
"""Minimum answer of a taxel [standard deviations]."""


@dataclass(frozen=True)
class Center:
    """Centre of symmetry along a line."""

    place: float
    """Position on the line [mm]."""
    uncertainty: float
    """Standard uncertainty [mm]."""
    strength: float
    """Largest answer [standard deviations of one]."""
    residual: float
    """Root mean square distance of the answers from the bell, as a share of its height [1]."""


def symmetric_center(place: np.ndarray, answer: np.ndarray, noise: float) -> Center | None:
    """Fit the centre of a symmetric answer.

    Args:
        place: Places along the line [mm], shape (n,).
        answer: Answers of one taxel [counts], shape (n,).
        noise: Standard deviation of an answer [counts].

    Returns:
        The centre, or None if the taxel does not answer, or the line does not reach across its answer.
    """
    peak = int(np.argmax(np.abs(answer)))
    strength = float(np.abs(answer[peak]) / max(noise, 1e-12))
    if strength < CLEAR:
        return None
    span = float(np.ptp(place))
    height = float(answer[peak])

    def residual(p: np.ndarray) -> np.ndarray:
        center, width, foot, top, base = p
        bell = (1 + ((place - center) / width) ** 2) ** -foot
        return (base + top * bell - answer / height) * (abs(height) / noise)

    lower, upper = [place.min(), 0.1, 0.5, 0.3, -0.5], [place.max(), 3 * span, 20.0, 3.0, 0.7]
    # The search starts from Boussinesq's exponent, 5/2.
    start = [float(np.clip(place[peak], lower[0] + 1e-3, upper[0] - 1e-3)), 0.5 * span, 2.5, 1.0, 0.0]
    # With a robust loss: one bad press must not move the centre.
    fit = least_squares(residual, start, bounds=(lower, upper), loss="soft_l1", x_scale=[0.1, 1.0, 1.0, 0.3, 0.1])
    center = float(fit.x[0])
    # At an end of the line one flank is missing, and the centre depends on both.
    if not place.min() + 0.1 * span < center < place.max() - 0.1 * span:
        return None
    residuals = residual(fit.x)
    # Not below the stated noise: nine answers may fit five numbers by chance.
    scale = max(float((residuals**2).sum()) / max(len(place) - 5, 1), 1.0)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * scale
    spread = float(np.sqrt(np.mean(residuals**2))) * noise / abs(height)
    return Center(center, max(float(np.sqrt(covariance[0, 0])), FLOOR), strength, spread)
