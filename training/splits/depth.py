"""The deepest presses are held out: does the network know depths beyond those that it has seen?"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return the deepest 15 % of the episodes, and all as deep as the shallowest of them (0.01 mm)."""
    depths = np.array([round(100 * e.depth) for e in episodes])
    limit = np.sort(depths)[-share(len(depths), TEST_SHARE)]
    return {e.number for e, depth in zip(episodes, depths, strict=True) if depth >= limit}
