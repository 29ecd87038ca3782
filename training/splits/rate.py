"""The fastest presses are held out: does the network know rates beyond those that it has seen?"""

from __future__ import annotations

import numpy as np

from tacdata.errors import FormatError
from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan
from tacdata.training.splits.split import TEST_SHARE, share


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return the fastest 15 % of the episodes, and all as fast as the slowest of them (0.01 mm/s).

    Raises:
        FormatError: If the dataset does not say how fast a press was.
    """
    unknown = [e.number for e in episodes if e.speed is None]
    if unknown:
        raise FormatError(
            f"the speed of {len(unknown)} episodes is not known, the first is {unknown[0]}",
            "episodes with their record",
            "give the dataset its records back (tacdata dataset restore), or choose another --split",
        )
    speeds = np.array([round(100 * (e.speed or 0.0)) for e in episodes])
    limit = np.sort(speeds)[-share(len(speeds), TEST_SHARE)]
    return {e.number for e, speed in zip(episodes, speeds, strict=True) if speed >= limit}
