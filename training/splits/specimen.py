"""Whole specimens of the sensor are held out: does the network know a sensor that it never saw?"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return every episode of 15 % of the specimens, at least one: those with the fewest episodes first.

    With two or three specimens a draw could take the one that most was recorded with; equal counts are drawn.
    """
    names = sorted({e.specimen for e in episodes})
    counts = {name: sum(e.specimen == name for e in episodes) for name in names}
    order = sorted(generator.permutation(names).tolist(), key=lambda name: counts[name])
    test_specimens = set(order[: share(len(names), TEST_SHARE)])
    return {e.number for e in episodes if e.specimen in test_specimens}
