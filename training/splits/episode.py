"""Random episodes are held out: does the network know presses of a kind that it has seen?

Repeats of one configuration may fall on both sides, as in any draw of trials; `configuration` keeps them
together.
"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return 15 % of the episodes, drawn at random."""
    numbers = [e.number for e in episodes]
    return set(generator.permutation(numbers)[: share(len(numbers), TEST_SHARE)].tolist())
