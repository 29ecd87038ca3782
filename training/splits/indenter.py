"""Whole indenter shapes are held out: does the network know shapes that it was never pressed with?"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return every episode of 15 % of the shapes, at least one, drawn at random."""
    shapes = sorted({e.shape for e in episodes})
    test_shapes = set(generator.permutation(shapes)[: share(len(shapes), TEST_SHARE)].tolist())
    return {e.number for e in episodes if e.shape in test_shapes}
