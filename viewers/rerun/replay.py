"""Replays of a grasp as a Rerun file: ball and fingertips in time, one replay beside the other."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from viewers import output_file

PAD = 0.009
"""Radius at which pads are drawn [m]."""
COLORS = ((214, 96, 77), (67, 147, 195), (90, 174, 97), (153, 112, 171), (200, 160, 60))
BALL = (222, 170, 60)


class Replay(Protocol):
    """What is drawn of a replay."""

    @property
    def time(self) -> np.ndarray:
        """Times [s], shape (n,)."""
        ...

    @property
    def ball(self) -> np.ndarray:
        """Centre of the ball [m], shape (n, 3)."""
        ...

    @property
    def tips(self) -> np.ndarray:
        """Centres of the pads [m], shape (n, f, 3)."""
        ...

    @property
    def held(self) -> bool:
        """Whether it was held."""
        ...


def save_replays(path: Path, replays: Mapping[str, Replay], sizes: tuple[float, ...]) -> None:
    """Write replays, by name, beside each other.

    Args:
        path: A new Rerun file.
        replays: Name -> replay.
        sizes: Radius of the ball, or half the sizes of the eraser [m].

    Raises:
        UsageError: If the file exists or is no Rerun file by its ending.
    """
    import rerun as rr

    output_file.new_file(path, output_file.RERUN)
    recording = rr.RecordingStream("tacdata_replay")
    recording.save(str(path))
    for number, (name, replay) in enumerate(replays.items()):
        shift = np.array([0.0, 0.25 * number, 0.0])
        text = f"{name}: {'held' if replay.held else 'lost'}"
        recording.log(f"{name}/verdict", rr.TextDocument(text), static=True)
        for t, ball, tips in zip(replay.time, replay.ball, replay.tips, strict=True):
            recording.set_time("replay", duration=float(t))
            place = ball + shift
            if len(sizes) == 1:
                drawn = rr.Points3D([place], radii=[sizes[0]], colors=[BALL], labels=[text])
            else:
                drawn = rr.Boxes3D(centers=[place], half_sizes=[sizes], colors=[BALL], labels=[text])
            recording.log(f"{name}/ball", drawn)
            colors = [COLORS[k % len(COLORS)] for k in range(len(tips))]
            recording.log(f"{name}/fingertips", rr.Points3D(tips + shift, radii=[PAD] * len(tips), colors=colors))
            recording.log(f"{name}/height_mm", rr.Scalars([1000 * float(ball[2])]))
    recording.flush()
    recording.disconnect()
