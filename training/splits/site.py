"""The edge of the array is held out: does a network that learned in the interior know the edge?"""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Sensor
from tacdata.training.frames.frames import EpisodeSpan


def held_out(episodes: tuple[EpisodeSpan, ...], sensor: Sensor, generator: np.random.Generator) -> set[int]:
    """Return the episodes whose nominal centre is nearer to the outermost ring of taxels than to the next."""
    taxels = sensor.taxels
    inner_x = taxels.pitch_x * (taxels.columns - 2) / 2
    inner_y = taxels.pitch_y * (taxels.rows - 2) / 2
    return {e.number for e in episodes if abs(e.x) > inner_x or abs(e.y) > inner_y}
