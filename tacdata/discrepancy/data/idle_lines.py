"""Lines in the spectrum of idle readings: hum of the mains, beats of a motor."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from tacdata.chain import Course

SHORTEST, LONGEST = 16, 256
"""Readings of a window."""
FEWEST = 6
"""Windows, at least."""
EVEN = 0.25
"""Successive readings of a window stand apart as usual, but for this share [1]."""
NEAR = 6
"""Bins on either side of a line from which the noise is estimated."""
CHANCE = 1e-6
"""Probability by which noise alone makes a bin as large."""
LEAST = 0.003
"""A smaller line, over the largest rise of the readings, is left alone [1]."""
MOST_LISTED = 4


def idle_lines(course: Course) -> list[str]:
    """Return in words which frequencies stand out of the readings without contact."""
    windows, interval = _windows(course)
    if len(windows) < FEWEST:
        return []
    length = windows.shape[1]
    shape = np.hanning(length + 2)[1:-1]
    at = np.arange(length) - (length - 1) / 2
    level = windows - windows.mean(axis=1, keepdims=True)
    level = level - at[:, None] * (np.einsum("t,wtc->wc", at, level) / (at @ at))[:, None]
    power = np.square(np.abs(np.fft.rfft(level * shape[:, None], axis=1))).mean(axis=0)
    amplitude = 2 * np.sqrt(power) / shape.sum()
    frequency = np.fft.rfftfreq(length, interval)
    first = 3  # the trend and the window's own width lie below
    reduced = course.reduced
    rise = float(np.nanmax(np.nanquantile(reduced.readings, 0.999, axis=0) - np.nanmedian(windows, axis=(0, 1))))
    # The mean of n periodograms of noise is a chi square variable with 2 n degrees of freedom.
    threshold = chi2.isf(CHANCE, 2 * len(windows)) / chi2.median(2 * len(windows))
    groups: dict[float, list[tuple[int, float]]] = {}
    for channel in range(power.shape[1]):
        spectrum = power[first:, channel]
        if not len(spectrum):
            continue
        top = int(np.argmax(spectrum))
        neighbours = np.concatenate(
            [spectrum[max(top - NEAR, 0) : max(top - 1, 0)], spectrum[top + 2 : top + 1 + NEAR]]
        )
        strong = amplitude[first + top, channel]
        # Slow recovery after a press falls from the lowest frequency on: a line rises above it.
        peak = top > 0 and len(neighbours) >= 3 and spectrum[top] > threshold * np.median(neighbours)
        if peak and strong > LEAST * rise:
            groups.setdefault(float(frequency[first + top]), []).append((channel, float(strong)))
    return [
        _said(course, hertz, lines, rise) for hertz, lines in sorted(groups.items(), key=lambda item: -len(item[1]))
    ][:MOST_LISTED]


def _said(course: Course, hertz: float, lines: list[tuple[int, float]], rise: float) -> str:
    names = [course.channel_names[c] for c, _ in lines[:MOST_LISTED]]
    more = f" and {len(lines) - len(names)} more" if len(lines) > len(names) else ""
    strong = 100 * max(by for _, by in lines) / rise
    return (
        f"{', '.join(names)}{more}: a line at {hertz:.3g} Hz, or an alias of it, of {strong:.2g} % of the largest rise "
        "in idle readings: hum of the mains, or a motor; record without contact with motors off and on"
    )


def _windows(course: Course) -> tuple[np.ndarray, float]:
    """Return evenly spaced readings without contact, shape (windows, length, channels), and their interval [s]."""
    reduced = course.reduced
    step = reduced.step[~reduced.first]
    interval = float(np.median(step)) if len(step) else 1.0
    idle = (reduced.tip[:, 2] <= 0) & np.isfinite(reduced.readings).all(axis=1)
    broken = ~idle | reduced.first | (np.abs(reduced.step - interval) > EVEN * interval)
    edges = np.concatenate([np.flatnonzero(broken), [len(idle)]])
    # A reading that breaks a stretch may begin the next one.
    spans = [(a if idle[a] else a + 1, b) for a, b in pairwise(edges)]
    spans = [(a, b) for a, b in spans if b - a >= SHORTEST]
    if not spans:
        return np.zeros((0, SHORTEST, reduced.channels)), interval
    usual = int(np.quantile([b - a for a, b in spans], 0.25))
    length = int(np.clip(2 ** int(np.log2(usual)), SHORTEST, LONGEST))
    starts = [a + k * length for a, b in spans for k in range((b - a) // length)]
    if not starts:
        return np.zeros((0, length, reduced.channels)), interval
    return np.stack([reduced.readings[a : a + length] for a in starts]), interval
