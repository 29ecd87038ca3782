"""Effects with memory, stepped in time."""

import numpy as np
from scipy.signal import lfilter


def late(u, w, tau):
    """Return a first-order follower of ``u`` over the session, implicit Euler, shape as ``u`` (n, k).

    Within a press the step of time is constant, so each press is one call of a recursive filter; between presses the
    sensor rests at the first row's value for the length of the pause.
    """
    y = np.empty_like(u)
    last = np.zeros(u.shape[1:])
    for rows in w.presses:
        a = w.step / (tau + w.step)
        first = w.gap[rows[0]] / (tau + w.gap[rows[0]]) if rows[0] else 0.0
        last = last + first * (u[rows[0]] - last)
        out, _ = lfilter([a], [1, a - 1], u[rows], axis=0, zi=((1 - a) * last)[None])
        y[rows], last = out, out[-1]
    return y


def wander(rng, w, tau, count):
    """Return a slow random wander of unit spread, shape (n, count)."""
    out, last = np.empty((len(w.clock), count)), rng.normal(size=count)
    for rows in w.presses:
        b = np.exp(-w.gap[rows[0]] / tau)
        last = b * last + np.sqrt(1 - b * b) * rng.normal(size=count)
        b = np.exp(-w.step / tau)
        kick = rng.normal(size=(len(rows), count)) * np.sqrt(1 - b * b)
        kick[0] = 0.0
        out[rows], _ = lfilter([1.0], [1, -b], kick, axis=0, zi=(last)[None])
        last = out[rows[-1]]
    return out
