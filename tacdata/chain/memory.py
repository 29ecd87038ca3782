"""Operators with memory along a course: building blocks of history effects."""

from __future__ import annotations

import numpy as np

STILL = 4.0
"""An input that moves by less is still, in standard deviations of its noise [1]."""
UNEVEN = 6.0
"""Rows spaced more unevenly do not say how an input bends there [1]."""
DOUBLE = 1e-4
"""Square of the damping, off 1: below, two poles are one [1]."""


def low_pass(values: np.ndarray, step: np.ndarray, tau: float) -> np.ndarray:
    """Return the solution of tau y' + y = u for u linear between rows, from rest.

    Exact for piecewise linear input: y_i = E y_{i-1} + (1 - w) u_i + (w - E) u_{i-1}, E = exp(-dt/tau),
    w = (1 - E) tau / dt.

    Args:
        values: Input, shape (n,) or (n, k).
        step: Time since the row before [s], shape (n,).
        tau: Time constant [s], above 0.
    """
    return low_passes(values, step, np.array([tau]), np.ones(1))


def low_passes(values: np.ndarray, step: np.ndarray, taus: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return the sum of `low_pass` by several time constants, each times its share, shape as the input.

    Args:
        values: Input, shape (n,) or (n, k).
        step: Time since the row before [s], shape (n,).
        taus: Time constants [s], above 0, shape (t,).
        shares: Their shares [1], shape (t,).
    """
    from tacdata.chain.memory_kernels import filtered

    ratio = step[:, None] / taus
    decay = np.exp(-np.minimum(ratio, 700.0))
    # The limit of (1 - exp(-x)) / x at 0 is 1; first rows have no time step.
    weight = np.where(ratio > 1e-8, -np.expm1(-ratio) / np.maximum(ratio, 1e-12), 1.0)
    return filtered(_wide(values), decay, weight, np.asarray(shares, dtype=float)).reshape(values.shape)


def low_pass_between(values: np.ndarray, step: np.ndarray, tau: float) -> np.ndarray:
    """Return the part of `low_pass` due to the curvature of the input between rows, exact for a parabola.

    A straight line is above a load that grows ever faster.

    Args:
        values: Input, shape (n, k).
        step: Time since the row before [s], shape (n,).
        tau: Time constant [s], above 0.
    """
    ratio = np.minimum(step / tau, 700.0)
    decay = np.exp(-ratio)
    # The filter's answer, at the end of a step, to a parabola that is zero at both rows.
    share = 0.5 * tau**2 * (2.0 - ratio - decay * (2.0 + ratio))
    return low_pass(values, step, tau) + _recursion(bends(values, step) * share[:, None], decay)


def second_order(values: np.ndarray, step: np.ndarray, tau: float, damping: float) -> np.ndarray:
    """Return the solution of y'' / w^2 + tau y' + y = u, w = 2 D / tau, for u linear between rows, from rest, (n,).

    One low-pass filter behind another is not exact.

    Args:
        values: Input u, 0 at first, shape (n,).
        step: Time since the row before [s], shape (n,).
        tau: How late y is behind a ramp [s], above 0.
        damping: D; 1 is critical, from there on y does not overshoot [1].
    """
    discriminant = damping**2 - 1
    # At a double pole partial fractions divide by zero: two poles a little apart stand for it.
    discriminant = discriminant if abs(discriminant) > DOUBLE else -DOUBLE
    if discriminant > 0:
        # Two real poles: by partial fractions, the difference of two first-order filters.
        taus = 0.5 * tau * (1 + np.array([1.0, -1.0]) * np.sqrt(discriminant) / damping)
        return low_passes(values, step, taus, taus * [1.0, -1.0] / (taus[0] - taus[1]))
    pole = 0.5 * tau * (1 + 1j * np.sqrt(-discriminant) / damping)
    ratio = step / pole
    ratio = np.where(ratio.real > 700.0, 700.0, ratio)
    decay = np.exp(-ratio)
    small = np.abs(ratio) < 1e-8
    weight = np.where(small, 1.0, (1 - decay) / np.where(small, 1.0, ratio))
    forcing = (1 - weight) * values + (weight - decay) * np.concatenate([[0.0], values[:-1]])
    # Turned along with the pole, only a real recursion is left of a complex one.
    turn = np.exp(-1j * np.cumsum(ratio.imag))
    rotated = forcing / turn
    parts = _recursion(np.stack([rotated.real, rotated.imag], axis=-1), np.abs(decay)) @ np.array([1.0, 1j])
    return (pole * parts * turn).imag / pole.imag


def _recursion(forcing: np.ndarray, decay: np.ndarray) -> np.ndarray:
    """Return y_i = E_i y_{i-1} + b_i, y_0 = 0, for ``forcing`` b, shape (n, k), and ``decay`` E, shape (n,)."""
    from tacdata.chain.memory_kernels import filtered

    # With w = E the filter adds (1 - E) u, so the forcing is divided by 1 - E.
    fresh = np.maximum(1 - decay, 1e-300)[:, None]
    return filtered(np.ascontiguousarray(forcing / fresh), decay[:, None], decay[:, None], np.ones(1))


def bends(values: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the second derivative of an input between each row and the one before [its unit / s^2], shape (n, k).

    It is 0 next to rows that are spaced too unevenly.

    Args:
        values: Input, shape (n, k).
        step: Time since the row before [s], shape (n,).
    """
    step_before, step_after = step[1:-1], step[2:]
    even = np.maximum(step_before, step_after) <= UNEVEN * np.minimum(step_before, step_after)
    even &= np.minimum(step_before, step_after) > 0
    width = np.where(even, 0.5 * (step_before + step_after), np.inf)[:, None]
    slope = np.diff(values, axis=0)
    slope /= np.maximum(step[1:], 1e-12)[:, None]
    bend = np.zeros(values.shape)
    np.divide(np.diff(slope, axis=0), width, out=bend[1:-1])
    count = np.zeros(len(values))
    count[1:-1] = even
    # Between two rows the bend is the mean of theirs, or the one that is known.
    rows_around = np.maximum(count[1:] + count[:-1], 1.0)[:, None]
    result = np.zeros(values.shape)
    np.divide(bend[1:] + bend[:-1], rows_around, out=result[1:])
    return result


def play(values: np.ndarray, width: float, anew: np.ndarray | None = None) -> np.ndarray:
    """Return the play operator: the output that follows an input through a dead band of +- ``width``, of its shape.

    y_i = max(u_i - w, min(u_i + w, y_{i-1})); before the first row the input came from below.

    Args:
        values: Input, shape (n,) or (n, k).
        width: Half the dead band, in the input's unit.
        anew: Rows at which it is reset, from below, shape (n,), bool; None for the first alone.
    """
    from tacdata.chain.memory_kernels import played

    forgets = np.zeros(len(values), dtype=bool) if anew is None else anew
    return played(_wide(values), width, forgets).reshape(values.shape)


def dead_band(values: np.ndarray, width: float, noise: float) -> np.ndarray:
    """Return the deviation of the output of a dead band from its measured input, shape (n,).

    Any dead band removes the noise of the measurement: that part of the change is not counted.

    Args:
        values: Input, shape (n,).
        width: Half the dead band, in the input's unit.
        noise: Standard deviation of the input's noise; 0 for a command.
    """
    still = STILL * noise
    return play(values, still + width) - play(values, still)


def slip_lags(values: np.ndarray, widths: np.ndarray, anew: np.ndarray) -> np.ndarray:
    """Return by how much elements that slip lie behind a falling input, shape (elements, n); 0 while it rises.

    Args:
        values: Input, shape (n,).
        widths: Half the band of each element, in the input's unit, shape (elements,).
        anew: Rows at which all elements are reset, shape (n,), bool.
    """
    return np.stack([play(values, width, anew) + width - values for width in widths.tolist()])


def slipping(values: np.ndarray, width: float, start: np.ndarray, gap: float = 0.0, power: float = 1.0) -> np.ndarray:
    """Return z of w dz/du = |1 - z sgn u'|^p, from -1 to 1, behind a gap, shape (n,).

    The gap is in series: it is crossed, with z = 0, between the fall of z and its rise. Exact between rows, as u is
    monotone there.

    Args:
        values: Input u, shape (n,).
        width: w of the turn, in the input's unit, above 0.
        start: z where it is set, NaN at all other rows, shape (n,); the first row's is.
        gap: Its width, in the input's unit.
        power: p: at 0 an element sticks until it slips (Jenkins), at 1 it yields gradually (Dahl) [1].
    """
    from tacdata.chain.memory_kernels import slipped

    return slipped(np.asarray(values, dtype=float) / width, gap / width, power, start)


def _wide(values: np.ndarray) -> np.ndarray:
    """Return values as floats of shape (n, k)."""
    return np.asarray(values, dtype=float).reshape(len(values), -1)


def running_max(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return the largest value so far within each group of rows (a place, for example), shape (n,)."""
    result = np.empty(len(values))
    for key in np.unique(group):
        rows = group == key
        result[rows] = np.maximum.accumulate(values[rows])
    return result


def delayed(values: np.ndarray, time: np.ndarray, episode: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """Return values as they were ``delay`` before each row, never across episodes.

    Between rows they bend. Straight lines would smooth them.

    Args:
        values: Shape (n, k).
        time: Time of each row [s], shape (n,).
        episode: Episode of each row, shape (n,).
        delay: How long before [s], shape (n,); negative for later.
    """
    values, instants = _wide(values), time - delay
    starts = np.searchsorted(episode, np.arange(episode[-1] + 1))
    ends = np.append(starts[1:], len(time))
    low, high = starts[episode], ends[episode] - 1
    instants = np.clip(instants, time[low], time[high])
    right = np.clip(np.searchsorted(time, instants), low + 1, high)
    right = np.maximum(right, 1)
    gap = np.maximum(time[right] - time[right - 1], 1e-12)
    share = np.clip((instants - time[right - 1]) / gap, 0.0, 1.0)
    lower = values.take(right - 1, axis=0)
    result = lower + share[:, None] * (values.take(right, axis=0) - lower)
    step = np.diff(time, prepend=time[0])
    # No curvature across episodes: an infinite step counts as too uneven.
    step[starts] = np.inf
    curved = bends(values, step).take(right, axis=0)
    # The distance of a parabola from its chord.
    curved *= (0.5 * share * (1 - share) * np.square(gap))[:, None]
    result -= curved
    return result
