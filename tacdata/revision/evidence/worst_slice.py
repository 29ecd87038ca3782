"""Slices of the sealed episodes with the largest gap, before and after."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.report.residual_slices import PHASES, phases
from tacdata.revision.comparison import Comparison
from tacdata.revision.evidence.gap import GapReduction, ResidualChange

FEW = 20
"""Minimum number of readings in a slice."""
THIRDS = [0, 1 / 3, 2 / 3, 1]


def sealed_slices(comparison: Comparison, change: GapReduction, episodes: np.ndarray) -> list[ResidualChange]:
    """Return the mean square by phase, depth, rate and channel, over the noise; each episode's offset is subtracted.

    Args:
        comparison: Recordings and the model before.
        change: The gap, with the models before and after.
        episodes: The sealed ones.
    """
    course = comparison.course.reduced
    squares = [comparison.squares(model, change.scale) for model in (change.before, change.after)]
    inside = np.isin(course.episode, episodes)
    slices = []
    for name, rows in _parts(course, inside):
        if rows.sum() >= FEW:
            count = len(np.unique(course.episode[rows]))
            slices.append(ResidualChange(name, count, *(float(np.nanmean(s[rows])) for s in squares)))
    for k, name in enumerate(course.channel_names):
        slices.append(ResidualChange(name, len(episodes), *(float(np.nanmean(s[inside, k])) for s in squares)))
    return slices


def _parts(course: Course, sealed: np.ndarray) -> list[tuple[str, np.ndarray]]:
    phase, depth, speed = phases(course), course.tip[:, 2], np.abs(course.speed)
    parts = [(name, sealed & (phase == k)) for k, name in enumerate(PHASES)]
    inside = sealed & (phase > 0)
    moving = inside & (phase != PHASES.index("hold"))
    for names, values, rows, unit in (
        (("shallow", "middle", "deep"), depth, inside, "mm"),
        (("slow", "medium", "fast"), speed, moving, "mm/s"),
    ):
        edges = np.quantile(values[rows], THIRDS) if rows.any() else np.zeros(4)
        for name, low, high in zip(names, edges[:-1], edges[1:], strict=True):
            parts.append((f"{name}, {low:.2g} to {high:.2g} {unit}", rows & (values >= low) & (values <= high)))
    return parts
