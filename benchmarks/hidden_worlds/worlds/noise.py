"""How a world shakes: contact, gains, wander and noise of four kinds."""

import numpy as np
from scipy.signal import lfilter

from worlds import skin

REALISMS = ("plain", "restless", "heavy", "hum")
"""plain: coloured and Gaussian; restless: contact, gains and wander three times as large; heavy: Student's t with
outliers, drops and repeated frames; hum: an aliased line, and more noise where more is read."""


def contact(rng, w, realism):
    """Return the error of pose of every press [mm], shape (episodes, 3)."""
    more = 3.0 if realism == "restless" else 1.0
    return more * rng.normal(0, [0.02, 0.02, 0.006], (len(w.presses), 3))


def gains(rng, realism):
    """Return the gain of every channel [1], shape (24,)."""
    return 1 + (0.06 if realism == "restless" else 0.03) * rng.normal(size=skin.CHANNELS)


def wandering(realism):
    """Return the spread of the slow wander of offsets [counts]."""
    return 4.5 if realism == "restless" else 1.5


def shaken(rng, time, clean, size, realism):
    """Return readings [counts] with noise, rounded."""
    shape = clean.shape
    kick = rng.standard_t(3, shape) / np.sqrt(3) if realism == "heavy" else rng.normal(size=shape)
    shaky = lfilter([np.sqrt(1 - 0.09)], [1, -0.3], kick, axis=0)
    if realism == "hum":
        rise = np.abs(clean - np.median(clean, axis=0))
        shaky = shaky * (1 + 1.5 * rise / max(rise.max(), 1e-9))
        shaky += 1.2 * np.sin(2 * np.pi * 6.7 * time[:, None] + rng.uniform(0, 2 * np.pi, shape[1]))
    if realism == "heavy":
        shaky += (rng.random(shape) < 0.002) * rng.normal(0, 40, shape)
    return np.round(clean + size * shaky)


def kept(rng, rows, realism):
    """Return which frames arrive, and from which one each has its values: some are lost, some repeated."""
    if realism != "heavy":
        return rows, rows
    there = rng.random(len(rows)) > 0.03
    there[[0, -1]] = True
    rows = rows[there]
    twice = rng.random(len(rows)) < 0.02
    twice[1:] &= ~twice[:-1]
    said = np.where(twice, np.roll(rows, 1), rows)
    said[0] = rows[0]
    return rows, said
