"""Slices of the sealed episodes with the largest gap, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.verdict.residual_slices import PHASES, phases
from tacdata.effects import Placed
from tacdata.revision.comparison import Comparison
from tacdata.revision.evidence.gap import ResidualChange

FEW = 20
"""Minimum number of readings in a slice."""
THIRDS = [0, 1 / 3, 2 / 3, 1]


def sealed_slices(held: Comparison, placed: Sequence[Placed], episodes: np.ndarray) -> list[ResidualChange]:
    """Return the mean square by phase, depth, rate and channel, over the noise; each episode's offset is subtracted.

    Args:
        held: Recordings and the model before.
        placed: The effects, their parameters fitted without these episodes.
        episodes: The sealed ones.
    """
    course, noise = held.course.reduced, held.null.noise
    scale = noise.scale[: course.channels] / np.sqrt(max(1 - noise.memory**2, 0.02))
    after = held.after(placed)
    square = [
        _squares(course, held.predicted(response, own)[held.course.read], scale)
        for response, own in ((held.before.response, []), (after.response, after.placed))
    ]
    there = np.isin(course.episode, episodes)
    found = []
    for name, rows in _parts(course, there):
        if rows.sum() >= FEW:
            count = len(np.unique(course.episode[rows]))
            found.append(ResidualChange(name, count, *(float(np.nanmean(s[rows])) for s in square)))
    for k, name in enumerate(course.channel_names):
        found.append(ResidualChange(name, len(episodes), *(float(np.nanmean(s[there, k])) for s in square)))
    return found


def _parts(course: Course, there: np.ndarray) -> list[tuple[str, np.ndarray]]:
    phase, depth, speed = phases(course), course.tip[:, 2], np.abs(course.speed)
    parts = [(name, there & (phase == k)) for k, name in enumerate(PHASES)]
    inside = there & (phase > 0)
    moving = inside & (phase != PHASES.index("hold"))
    for names, values, rows, unit in (
        (("shallow", "middle", "deep"), depth, inside, "mm"),
        (("slow", "medium", "fast"), speed, moving, "mm/s"),
    ):
        edges = np.quantile(values[rows], THIRDS) if rows.any() else np.zeros(4)
        for name, low, high in zip(names, edges[:-1], edges[1:], strict=True):
            parts.append((f"{name}, {low:.2g} to {high:.2g} {unit}", rows & (values >= low) & (values <= high)))
    return parts


def _squares(course: Course, predicted: np.ndarray, scale: np.ndarray) -> np.ndarray:
    left = (course.readings - predicted) / scale
    for number in np.unique(course.episode):
        own = course.episode == number
        left[own] -= np.nanmedian(left[own], axis=0)
    return np.square(left)
