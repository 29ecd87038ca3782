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
    present = count > 1
    length = np.where(present, end - begin, 1.0)
    number = np.arange(1, MOST_MODES + 1)
    # Karhunen and Loeve: a Brownian motion over an episode as cosines, with variances that fall as 1 / k^2.
    variance = 2 * rate * length[:, None] / (np.pi * number) ** 2
    # Information on a cosine, whose mean square is 1/2. Slow AR(1) noise is larger than its innovations by 1 / (1 -
    # m)^2.
    precision = 0.5 * count[:, None] * (1 - memory) ** 2
    is_visible = np.median((variance * precision)[present], axis=0) > SHOWS
    limit = int(np.argmin(is_visible)) if not is_visible.all() else MOST_MODES
    if not limit:
        return None
    share = (course.time - begin[course.episode]) / np.maximum(length, 1e-9)[course.episode]
    size = np.sqrt(variance[:, :limit])[course.episode]
    return (size * np.cos(np.pi * number[:limit] * share[:, None])).astype(np.float32)


def walk_rate(residual: np.ndarray, course: Course, scale: np.ndarray, memory: float, place: np.ndarray) -> float:
    """Return the rate of the random walk [noise scales squared a second], 0 where it is unknown.

    Args:
        residual: Residual of an over-rich fit [each stream's unit], shape (m, streams); NaN where nothing was read.
        course: With the rows read alone.
        scale: Standard deviation of the innovations of rows, shape (streams,).
        memory: Correlation of successive rows [1].
        place: Of each episode, shape (episodes,).
    """
    quiet = course.tip[:, 2] <= max(0.0, float(course.tip[:, 2].min()) + 0.05 * course.stroke)
    streams = residual[:, : course.channels] / scale[: course.channels]
    quiet &= np.isfinite(streams).all(axis=1)
    steps, errors, of, halves = [], [], [], []
    edges = np.searchsorted(course.episode, np.arange(course.episodes + 1))
    for episode, (first, last) in enumerate(pairwise(edges)):
        rows = np.arange(first, last)
        pressed = rows[~quiet[rows]]
        if not len(pressed):
            continue
        start, end = rows[quiet[rows] & (rows < pressed[0])], rows[quiet[rows] & (rows > pressed[-1])]
        if min(len(start), len(end)) < QUIET_ROWS:
            continue
        t0, t1 = course.time[start], course.time[end]
        # Means over stretches of a Brownian motion: a third of each stretch counts.
        interval = float(t1[0] - t0[-1] + (np.ptp(t0) + np.ptp(t1)) / 3)
        # From the rest before to the rest after a press: the offset alone, as nothing presses at either.
        steps.append((streams[end].mean(axis=0) - streams[start].mean(axis=0)) / np.sqrt(interval))
        errors.append((1 / len(start) + 1 / len(end)) / ((1 - memory) ** 2 * interval))
        of.append(place[episode])
        halves += [_halved(streams[part]) for part in (start, end) if len(part) >= 2 * QUIET_ROWS]
    if not steps:
        return 0.0
    step, error, where = np.array(steps), np.array(errors), np.array(of)
    if halves:
        # A hum makes rows scatter, and means hardly.
        heard = float(np.median(np.square(np.concatenate(halves))) / readings.MEDIAN_CHI2) * (1 - memory) ** 2
        error *= np.clip(heard, *MEANS_SCATTER)
    gaps, unsure = [], []
    for key in np.unique(where):
        changes = np.diff(step[where == key], axis=0)
        gaps.append(changes.ravel())
        unsure.append(np.repeat(error[where == key][1:] + error[where == key][:-1], step.shape[1]))
    return readings.spread_of(np.concatenate(gaps), np.concatenate(unsure)) ** 2


def _halved(values: np.ndarray) -> np.ndarray:
    """Return the difference of the means of two halves (n, streams), over that expected of unit white noise [1]."""
    first, second = np.array_split(values, 2)
    return (second.mean(axis=0) - first.mean(axis=0)) / np.sqrt(1 / len(first) + 1 / len(second))
