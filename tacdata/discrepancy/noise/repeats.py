"""Episodes that repeat one another: their differences are random, and no effect of depth or rate."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course

ALIKE = (0.12, 0.35, 0.35)
"""Repeats: largest difference in depth, in time to the top, in time of contact [natural logarithm]."""
TOUCHING = 0.05
"""Contact is deeper than this share of the stroke [1]."""
RISE = (0.2, 0.9)
"""Time to the top: between these shares of an episode's depth [1]."""
ENOUGH = 0.3
"""Repeats are used where they make so many pairs, over the number of episodes [1]."""


def repeats(course: Course, place: np.ndarray) -> np.ndarray:
    """Return a number for each episode that those which repeat it share, shape (episodes,), int64.

    They press the same place as deep, as fast and as long. Where too few do, all episodes of a place count as repeats.

    Args:
        course: With the rows read alone.
        place: Of each episode, shape (episodes,).
    """
    profiles, result = _told(course), np.zeros(course.episodes, dtype=np.int64)
    groups: list[tuple[int, np.ndarray]] = []
    for episode, (at, profile) in enumerate(zip(place, profiles, strict=True)):
        near = [
            k
            for k, (where, reference) in enumerate(groups)
            if where == at and np.all(np.abs(profile - reference) <= ALIKE)
        ]
        if not near:
            groups.append((int(at), profile))
        result[episode] = near[0] if near else len(groups) - 1
    complete = result[np.isfinite(profiles).all(axis=1)]
    pairs = len(complete) - len(np.unique(complete))
    return result if pairs >= ENOUGH * len(complete) else place.astype(np.int64)


def _told(course: Course) -> np.ndarray:
    """Return how deep, how fast and how long each episode presses [natural logarithm], NaN where nothing was read."""
    profiles = np.full((course.episodes, 3), np.nan)
    away = max(0.0, float(course.tip[:, 2].min())) + TOUCHING * course.stroke
    for episode in np.unique(course.episode):
        rows = course.episode == episode
        depth, time = course.tip[rows, 2], course.time[rows]
        pressed = np.flatnonzero(depth > away)
        if len(pressed) < 2:
            continue
        top = int(np.argmax(depth))
        reach = float(depth[top]) - away
        first, last = (int(np.argmax(depth[: top + 1] >= away + share * reach)) for share in RISE)
        rise = max(float(time[last] - time[first]), float(np.median(np.diff(time))))
        lasting = max(float(time[pressed[-1]] - time[pressed[0]]), 1e-6)
        profiles[episode] = np.log([max(reach, 1e-9), max(rise, 1e-6), lasting])
    return profiles
