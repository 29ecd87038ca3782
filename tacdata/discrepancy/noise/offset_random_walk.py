"""How offsets go on within an episode: the modes of a Brownian motion, and its rate.

Electronics do not stand still while a finger is pressed: their noise is larger the slower it is. About the mean over
an episode of length T a Brownian motion of rate q is a sum of cos(k pi t / T) with independent amplitudes of variance
2 q T / (k pi)^2 (its Karhunen-Loeve series). Whatever a press remembers looks much like the first few of them. The rate
is estimated without contact, from how far an offset after a press is off the one before it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise import readings

MOST_MODES = 8
"""Karhunen-Loeve series: most modes."""
SHOWS = 0.03
"""Karhunen-Loeve series: a mode counts while its variance is this share of its reading error's [1]."""
MEANS_SCATTER = (0.05, 1.5)
"""Bounds of the variance of a mean over that of independent rows: hum averages out [1]."""
QUIET_ROWS = 3
"""Rows without contact from which an offset before or after a press is read, at least."""


def modes(rate: float, course: Course, memory: float) -> np.ndarray | None:
    """Return the effect of one standard deviation of each mode [noise scales], shape (m, modes); None for none.

    Args:
        rate: Of the random walk [noise scales squared a second].
        course: With the rows read alone.
        memory: Correlation of successive rows [1].
    """
    count = np.bincount(course.episode, minlength=course.episodes)
    begin = np.full(course.episodes, np.inf)
    np.minimum.at(begin, course.episode, course.time)
    end = np.full(course.episodes, -np.inf)
    np.maximum.at(end, course.episode, course.time)
    there = count > 1
    length = np.where(there, end - begin, 1.0)
    number = np.arange(1, MOST_MODES + 1)
    variance = 2 * rate * length[:, None] / (np.pi * number) ** 2
    # Information on a cosine, whose mean square is 1/2. Slow AR(1) noise is larger than its innovations by 1 / (1 -
    # m)^2.
    known = 0.5 * count[:, None] * (1 - memory) ** 2
    shown = np.median((variance * known)[there], axis=0) > SHOWS
    most = int(np.argmin(shown)) if not shown.all() else MOST_MODES
    if not most:
        return None
    share = (course.time - begin[course.episode]) / np.maximum(length, 1e-9)[course.episode]
    size = np.sqrt(variance[:, :most])[course.episode]
    return (size * np.cos(np.pi * number[:most] * share[:, None])).astype(np.float32)


def walk_rate(rest: np.ndarray, course: Course, scale: np.ndarray, memory: float, place: np.ndarray) -> float:
    """Return the rate of the random walk [noise scales squared a second], 0 where it is unknown.

    Args:
        rest: Residual of an over-rich fit [each stream's unit], shape (m, streams); NaN where nothing was read.
        course: With the rows read alone.
        scale: Standard deviation of the innovations of rows, shape (streams,).
        memory: Correlation of successive rows [1].
        place: Of each episode, shape (episodes,).
    """
    quiet = course.tip[:, 2] <= max(0.0, float(course.tip[:, 2].min()) + 0.05 * course.stroke)
    streams = rest[:, : course.channels] / scale[: course.channels]
    quiet &= np.isfinite(streams).all(axis=1)
    steps, known, of, halves = [], [], [], []
    edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
    for episode, (first, last) in enumerate(pairwise(edges)):
        rows = np.arange(first, last)
        pressed = rows[~quiet[rows]]
        if not len(pressed):
            continue
        before, after = rows[quiet[rows] & (rows < pressed[0])], rows[quiet[rows] & (rows > pressed[-1])]
        if min(len(before), len(after)) < QUIET_ROWS:
            continue
        t0, t1 = course.time[before], course.time[after]
        # Means over stretches of a Brownian motion: a third of each stretch counts.
        apart = float(t1[0] - t0[-1] + (np.ptp(t0) + np.ptp(t1)) / 3)
        steps.append((streams[after].mean(axis=0) - streams[before].mean(axis=0)) / np.sqrt(apart))
        known.append((1 / len(before) + 1 / len(after)) / ((1 - memory) ** 2 * apart))
        of.append(place[episode])
        halves += [_halved(streams[part]) for part in (before, after) if len(part) >= 2 * QUIET_ROWS]
    if not steps:
        return 0.0
    step, error, where = np.array(steps), np.array(known), np.array(of)
    if halves:
        # A hum makes rows scatter, and means hardly.
        heard = float(np.median(np.square(np.concatenate(halves))) / readings.MEDIAN_CHI2) * (1 - memory) ** 2
        error *= np.clip(heard, *MEANS_SCATTER)
    gaps, unsure = [], []
    for key in np.unique(where):
        own = np.diff(step[where == key], axis=0)
        gaps.append(own.ravel())
        unsure.append(np.repeat(error[where == key][1:] + error[where == key][:-1], step.shape[1]))
    return readings.spread_of(np.concatenate(gaps), np.concatenate(unsure)) ** 2


def _halved(values: np.ndarray) -> np.ndarray:
    """Return the difference of the means of two halves (n, streams), over that expected of unit white noise [1]."""
    first, second = np.array_split(values, 2)
    return (second.mean(axis=0) - first.mean(axis=0)) / np.sqrt(1 / len(first) + 1 / len(second))
