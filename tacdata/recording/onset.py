"""Estimates the height of first contact from a slow approach, by a hinge b + A (z0 - z)^p for z < z0.

A threshold on the answer finds contact too late, by an amount that depends on the noise. On soft skins that is far more
than the guide's resolution. Fitting the foot of the curve has no such bias if the power p is free. It is 1 for a flat
spring, 3/2 for a sphere on a half space (K. L. Johnson, Contact Mechanics, eq. 4.23) and up to 2 for a sphere on a bed
of springs.

For each z0 and p the rest is linear and solved with Huber's weights against outliers. The uncertainty of z0 is its
profile likelihood: where the misfit, with p free, grows by one unit of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

POWERS = np.linspace(1.0, 2.4, 29)
"""Powers in the search grid [1]."""
GRID = 161
"""Number of heights in the search grid."""
HUBER = 1.5
"""Residual beyond which a reading counts less [standard deviations]."""
FLOOR = 0.003
"""Smallest uncertainty that is stated [mm]: three decimals of a report and a micro-step of the guide."""
FOOT = 0.08
"""Depth down to which the answer is assumed to be a power [mm]."""
CLEAR = 8.0
"""Minimum answer at the lowest point for a fit [standard deviations of a reading]."""


@dataclass(frozen=True)
class Onset:
    """First contact in one approach."""

    height: float
    """Machine height of first contact [mm]."""
    uncertainty: float
    """Its standard uncertainty [mm]."""
    power: float
    """Power of the answer in depth [1]."""
    strength: float
    """Answer at the lowest point [standard deviations of a reading]."""
    model: float
    """Systematic uncertainty by the unknown power and the steps of the approach [mm]; common to all places."""


def combined(readings: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Combine the channels' answers into one with unit noise (matched filter).

    Each weight is the answer at the deepest readings over the noise squared.

    Args:
        readings: Mean readings [counts], shape (n, channels), from the highest to the lowest.
        noise: Standard deviation of such a mean [counts], shape (channels,).
    """
    rise = readings[-3:].mean(axis=0) - readings[:3].mean(axis=0)
    weight = rise / noise**2
    scale = np.sqrt(((weight * noise) ** 2).sum())
    return (readings - readings[:3].mean(axis=0)) @ weight / max(scale, 1e-12)


def onset(height: np.ndarray, answer: np.ndarray, power: float | None = None) -> Onset | None:
    """Fit the height of first contact.

    The curve is fitted twice: whole, and down to `FOOT` below the first fit's contact. Where the two contradict each
    other, the deeper answer is no power (a gap that closes, a layer that ends), and the foot alone is used.

    Args:
        height: Machine heights [mm], shape (n,), falling.
        answer: Answers with unit noise [standard deviations], shape (n,).
        power: Power of the answer in depth, if it is known [1].

    Returns:
        The onset, or None if the answer is too weak or the approach began in contact.
    """
    strength = float(answer[-3:].mean() - answer[:3].mean())
    if len(height) < 8 or strength < CLEAR:
        return None
    powers = POWERS if power is None else np.array([power])
    fit = _fit(height, answer, powers)
    if fit is None:
        return None
    place, width, best = fit
    # The power law holds near first contact alone. A second fit there shows how much the far part pulled.
    foot = height >= place - FOOT
    near = _fit(height[foot], answer[foot], powers) if foot.sum() >= 8 and answer[foot][-1] > CLEAR else None
    # Contact is anywhere within a step of the approach: the standard deviation of a uniform distribution.
    model = float(np.median(-np.diff(height))) / np.sqrt(12)
    if near is not None and abs(near[0] - place) > 2 * np.hypot(near[1], width):
        model = float(np.hypot(model, near[0] - place))
        place, width, best = near
    return Onset(place, max(width, FLOOR), best, strength, model)


def shared_power(curves: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, float]:
    """Return the power that fits all approaches best, and its standard uncertainty [1].

    Indenter and skin are the same everywhere, so the power is too. Fitted to each approach alone, its error would move
    the heights by different amounts and tilt the plane.

    Args:
        curves: Heights [mm] and answers [standard deviations] of each approach.
    """
    total, scale = np.zeros(len(POWERS)), 0.0
    for height, answer in curves:
        best = _misfits(height, answer, _trial(height), POWERS).min(axis=0)
        total += best
        scale += max(float(best.min()) / max(len(height) - 4, 1), 1.0) / len(curves)
    within = POWERS[total <= total.min() + scale]
    return float(POWERS[int(np.argmin(total))]), max(float(np.ptp(within)) / 2, float(POWERS[1] - POWERS[0]) / 2)


def _trial(height: np.ndarray) -> np.ndarray:
    step = float(np.median(-np.diff(height)))
    return np.linspace(height[-1] + 2 * step, height[0], GRID)


def _fit(height: np.ndarray, answer: np.ndarray, powers: np.ndarray) -> tuple[float, float, float] | None:
    """Return z0 [mm], its uncertainty [mm] and the power; None if contact came before the first reading."""
    trial = _trial(height)
    misfit = _misfits(height, answer, trial, powers)
    profile = misfit.min(axis=1)
    best = int(np.argmin(profile))
    # The best height is at the top of the search: contact began before the first reading.
    if best >= GRID - 2:
        return None
    # Noise as the residuals show it, never less than that of the idle readings.
    scale = max(profile[best] / max(len(height) - 4, 1), 1.0)
    within = trial[profile <= profile[best] + scale]
    width = max(float(within.max() - within.min()) / 2, float(trial[1] - trial[0]) / 2)
    power = float(powers[int(np.argmin(misfit[best]))])
    return float(within.max() + within.min()) / 2, width, power


def _misfits(height: np.ndarray, answer: np.ndarray, trial: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Return the robust misfit of every height and power, shape (heights, powers); b and A are solved for."""
    hinge = np.maximum(trial[:, None, None] - height, 0.0) ** powers[None, :, None]
    weight = np.ones_like(hinge)
    residual = np.broadcast_to(answer, hinge.shape)
    # Iteratively reweighted least squares: at given weights b and A have closed forms.
    for _ in range(4):
        total = weight.sum(axis=-1)
        mean_h, mean_y = (weight * hinge).sum(axis=-1) / total, (weight * answer).sum(axis=-1) / total
        off_h, off_y = hinge - mean_h[..., None], answer - mean_y[..., None]
        slope = (weight * off_h * off_y).sum(axis=-1) / np.maximum((weight * off_h**2).sum(axis=-1), 1e-30)
        residual = off_y - slope[..., None] * off_h
        # 1.4826 times the median absolute deviation is a Gaussian's standard deviation.
        spread = np.maximum(1.0, 1.4826 * np.median(np.abs(residual), axis=-1))[..., None]
        weight = np.minimum(1.0, HUBER * spread / np.maximum(np.abs(residual), 1e-12))
    size = np.abs(residual)
    # An outlier counts as a residual of three standard deviations and hardly more.
    return np.where(size <= 3.0, size**2, 9.0 + np.log1p(np.maximum(size - 3.0, 0.0))).sum(axis=-1)
