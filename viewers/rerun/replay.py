"""Replays of a grasp or wipe as a Rerun file: object and fingertips in time, replays side by side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tacdata.replay.outcome import ReplayOutcome
from tacdata.replay.targets import FingertipTargets
from tacdata.viewers import output_file
from tacdata.viewers.scene.color_scale import HUES

if TYPE_CHECKING:
    import rerun as rr

PAD = 0.009
"""Radius at which pads are drawn [m]."""
OBJECT, SUPPORT, BRIDGED = (222, 170, 60), (200, 200, 200), (220, 20, 60)
APART = 0.25
"""Distance between two replays along y [m]."""
BOARD = (0.12, 0.12, 0.002)
"""Half the sizes of the piece of table or board that is drawn [m]."""


def save_replays(path: Path, replays: Mapping[str, ReplayOutcome], targets: FingertipTargets) -> None:
    """Write replays, by kind, side by side.

    Args:
        path: A new Rerun file.
        replays: Kind -> its outcome.
        targets: The targets that were replayed: fingers whose path is bridged are marked.

    Raises:
        UsageError: If the file exists or is no Rerun file by its ending.
    """
    import rerun as rr

    output_file.new_file(path, output_file.RERUN)
    recording = rr.RecordingStream("tacdata_replay")
    recording.save(str(path))
    for number, (name, replay) in enumerate(replays.items()):
        shift = np.array([0.0, APART * number, 0.0])
        colors = [HUES[k % len(HUES)] for k in range(len(replay.fingers))]
        word = "board" if replay.scene.task == "wipe" else "table"
        ground = replay.path.centre[0] + shift - (0.0, 0.0, replay.scene.body.height + BOARD[2])
        board = rr.Boxes3D(centers=[ground], half_sizes=[BOARD], colors=[SUPPORT], labels=[word])
        recording.log(f"{name}/{word}", board, static=True)
        for curve in ("force_N", "slip_mm"):
            lines = rr.SeriesLines(names=list(replay.fingers), colors=colors)
            recording.log(f"{name}/{curve}", lines, static=True)
        for row, t in enumerate(replay.time.tolist()):
            recording.set_time("replay", duration=t)
            verdict = replay.reason if t >= replay.decided else "not yet decided"
            recording.log(f"{name}/verdict", rr.TextDocument(f"{name}: {verdict}"))
            place = replay.path.centre[row] + shift
            recording.log(f"{name}/object", _drawn(replay, place, f"{name}: {verdict.split(':')[0]}"))
            bridged = targets.gap[row]
            marked = [BRIDGED if gap else color for gap, color in zip(bridged, colors, strict=True)]
            labels = [f"{n}: path bridged" if gap else n for n, gap in zip(replay.fingers, bridged, strict=True)]
            tips = replay.path.tips[row] + shift
            recording.log(
                f"{name}/fingertips", rr.Points3D(tips, radii=[PAD] * len(tips), colors=marked, labels=labels)
            )
            recording.log(f"{name}/height_mm", rr.Scalars([1000 * float(place[2])]))
            recording.log(f"{name}/force_N", rr.Scalars(replay.path.force[row]))
            recording.log(f"{name}/slip_mm", rr.Scalars(1000 * replay.path.slip[row]))
    recording.flush()
    recording.disconnect()


def _drawn(replay: ReplayOutcome, place: np.ndarray, label: str) -> rr.Points3D | rr.Boxes3D | rr.Cylinders3D:
    """Return the object, upright, at a place [m]."""
    import rerun as rr

    sizes = replay.scene.body.sizes
    if replay.scene.body.geometry == "sphere":
        return rr.Points3D([place], radii=[sizes[0]], colors=[OBJECT], labels=[label])
    if replay.scene.body.geometry == "cylinder":
        return rr.Cylinders3D(
            lengths=[2 * sizes[1]], radii=[sizes[0]], centers=[place], colors=[OBJECT], labels=[label]
        )
    return rr.Boxes3D(centers=[place], half_sizes=[sizes], colors=[OBJECT], labels=[label])
