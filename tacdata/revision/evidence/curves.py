"""Measured readings of a few episodes, and those that the model predicts before and after."""

import numpy as np

from tacdata.revision.comparison import Comparison
from tacdata.revision.evidence.gap import GapReduction
from tacdata.viewers.scene.episode_curves import EpisodeCurves


def curves(comparison: Comparison, change: GapReduction, episodes: np.ndarray, count: int = 3) -> list[EpisodeCurves]:
    """Return the episodes in which the effects change most, largest change first.

    Args:
        comparison: Recordings and the model before.
        change: The gap, with the models before and after: figures and pictures are of the same models.
        episodes: Those to choose from.
        count: Number of episodes at most.
    """
    course, scale = comparison.course, change.scale
    initial, revised = (comparison.predicted(model.response, model.placed) for model in (change.before, change.after))
    size = np.square((revised - initial) / scale).mean(axis=1)
    order = sorted(episodes.tolist(), key=lambda e: -float(size[course.episode == e].mean()))[:count]
    episode_curves = []
    for e in order:
        rows = np.flatnonzero((course.episode == e) & (course.averaged > 0))
        measured = course.readings[rows]

        # A constant per episode belongs to the calibration: both predictions are shifted to the measured median.
        levels = [p[rows] + np.nanmedian(measured - p[rows], axis=0) for p in (initial, revised)]
        time, depth = course.time[rows] - course.time[rows[0]], course.tip[rows, 2]
        name, channels = course.names[e], course.channel_names
        episode_curves.append(EpisodeCurves(name, time, depth, measured, *levels, scale, channels))
    return episode_curves
