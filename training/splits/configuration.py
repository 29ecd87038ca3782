"""Random configurations are held out with all their repeats: does the network know places it never felt?"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return every episode of 15 % of the configurations (indenter, site and depth, to 0.01 mm)."""
    kinds = sorted({_configuration(e) for e in episodes})
    order = generator.permutation(len(kinds))[: share(len(kinds), TEST_SHARE)]
    test_kinds = {kinds[i] for i in order}
    return {e.number for e in episodes if _configuration(e) in test_kinds}


def _configuration(episode: EpisodeSpan) -> tuple[str, int, int, int]:
    x, y, depth = (round(100 * value) for value in (episode.x, episode.y, episode.depth))
    return episode.indenter, x, y, depth
