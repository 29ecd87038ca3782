"""Operators with memory along a course: what effects of history are built from."""

from __future__ import annotations

import numpy as np

STILL = 4.0
"""An input that moves by less is still, in standard deviations of its noise [1]."""


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
    weight = np.where(ratio > 1e-8, -np.expm1(-ratio) / np.maximum(ratio, 1e-12), 1.0)
    return filtered(_wide(values), decay, weight, np.asarray(shares, dtype=float)).reshape(values.shape)


def play(values: np.ndarray, width: float, anew: np.ndarray | None = None) -> np.ndarray:
    """Return the play operator: what follows an input through a dead band of +- ``width``, shape as the input.

    y_i = max(u_i - w, min(u_i + w, y_{i-1})); before the first row the input came from below.

    Args:
        values: Input, shape (n,) or (n, k).
        width: Half the dead band, in the input's unit.
        anew: Rows at which it begins anew, come from below, shape (n,), bool; None for the first alone.
    """
    from tacdata.chain.memory_kernels import played

    forgets = np.zeros(len(values), dtype=bool) if anew is None else anew
    return played(_wide(values), width, forgets).reshape(values.shape)


def dead_band(values: np.ndarray, width: float, noise: float) -> np.ndarray:
    """Return by how much what follows a measured input through a dead band is off it, shape (n,).

    Any dead band takes up the noise of what was measured: what that would change is not this one's doing.

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
        anew: Rows at which all elements begin anew, shape (n,), bool.
    """
    return np.stack([play(values, width, anew) + width - values for width in widths.tolist()])


def slipping(values: np.ndarray, width: float, first: np.ndarray) -> np.ndarray:
    """Return z of dz = (1 - z sgn du) du / w: -1 to 1 as an input rises by far more than ``width``, shape (n,).

    Exact between rows, as u is monotone there: z_i = s + (z_{i-1} - s) exp(-|du| / w), s the sign of du.

    Args:
        values: Input u, shape (n,).
        width: Of the turn, in the input's unit, above 0.
        first: Rows at which z begins anew at -1, shape (n,), bool.
    """
    from tacdata.chain.memory_kernels import filtered

    change = np.where(first, 0.0, np.diff(values, prepend=values[:1]))
    keep = np.where(first, 0.0, np.exp(-np.abs(change) / width))
    toward = np.where(first, -1.0, np.sign(change))
    return filtered(_wide(toward + 1.0), keep[:, None], keep[:, None], np.ones(1)).reshape(values.shape) - 1.0


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
    """Return values as they were ``delay`` before each row, linear between rows, never across episodes.

    Args:
        values: Shape (n, k).
        time: Time of each row [s], shape (n,).
        episode: Episode of each row, shape (n,).
        delay: How long before [s], shape (n,); negative for later.
    """
    from tacdata.chain.memory_kernels import between

    wanted = time - delay
    starts = np.searchsorted(episode, np.arange(episode[-1] + 1))
    ends = np.append(starts[1:], len(time))
    low, high = starts[episode], ends[episode] - 1
    wanted = np.clip(wanted, time[low], time[high])
    right = np.clip(np.searchsorted(time, wanted), low + 1, high)
    right = np.maximum(right, 1)
    gap = np.maximum(time[right] - time[right - 1], 1e-12)
    share = np.clip((wanted - time[right - 1]) / gap, 0.0, 1.0)
    return between(_wide(values), right, share)
