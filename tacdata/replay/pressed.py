"""A recorded press in the shape of a demonstration, so that every export format takes sessions too."""

from __future__ import annotations

import numpy as np

from tacdata.dataset.frames import recording_hash
from tacdata.demonstrations.demonstration import Demonstration, FingerTrack
from tacdata.recording.episode import Episode

FINGER = "index"
"""Name of the sensor: formats for hands know no other pad."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def pressed(episode: Episode) -> Demonstration:
    """Return a press: the tip's nominal path in the sensor's frame, and tared readings, at the board's own times.

    Args:
        episode: A recording of `tacdata record`.

    Raises:
        FormatError: If no frame is at rest, so that the readings cannot be tared.
    """
    times, count = episode.taxels.sample_ns, len(episode.taxels.sample_ns)
    place = episode.tip_at(times) * (1, 1, -1) / 1000  # a depth is a way down
    track = FingerTrack(
        FINGER,
        "right",
        FINGER,
        place,
        np.tile(UPRIGHT, (count, 1)),
        np.zeros((count, 6, 6)),
        np.zeros(count, bool),
        count,
        0,
        episode.tared.astype(np.float32),
    )
    return Demonstration(
        episode.path.name,
        recording_hash(episode),
        f"press the skin with {episode.press.indenter_name}",
        "sensor",
        episode.sensor.taxels.rate,
        times,
        {FINGER: track},
        {FINGER: episode.sensor},
        remarks=("poses are the nominal tip of the tool in the sensor's frame",),
    )
