"""Makes the job of a recorded episode: the press whose solution its label needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tacdata import provenance
from tacdata.errors import FormatError
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder, goes_up_otherwise
from tacdata.recording.episode import Episode
from tacdata.sensor import Sensor

SAME_DEPTH = 0.005
"""A recorded press this near its plan's depth [mm] takes that depth, so that repetitions share a job."""
SAME_PLACE = 0.02
"""A recorded press this near its plan's place [mm] takes the plan's place."""
DEPTH_GRID, PLACE_GRID = 0.01, 0.01
"""Spacing [mm] of the depths (rounded up) and places that other presses are given."""
WANDER_LIMIT = 0.1
"""Sideways motion in contact [mm] beyond which a recording is no vertical press."""
RELOAD_LIMIT = 0.05
"""Fall and rise of the depth within one branch [mm] beyond which a recording is not one press."""


@dataclass(frozen=True)
class LabelRequest:
    """The frames of one episode and the job that its label needs."""

    episode: int
    """Number of the episode in its session."""
    recording: str
    """SHA-256 of the recording's file."""
    sensor: Sensor
    """The skin that the label is of."""
    model: str
    """Content hash of the skin model."""
    time_ns: np.ndarray
    """Estimated sample times of the taxel frames [ns], shape (n,), int64."""
    tip: np.ndarray
    """Nominal x, y and depth of the indenter's lowest point at these times [mm], shape (n, 3)."""
    deepest_ns: int
    """Time at which the nominal path first reaches its deepest point [ns]."""
    job: Job | None
    """The path to solve; None if the indenter never touches."""


@dataclass(frozen=True)
class Planned:
    """A request without its frames, kept until its press is solved: frames of a session may exceed memory."""

    episode: int
    """Number of the episode in its session."""
    recording: str
    """SHA-256 of the recording's file."""
    sensor: Sensor
    """The skin that the label is of."""
    model: str
    """Content hash of the skin model."""
    job: Job | None
    """The path to solve; None if the indenter never touches."""

    @classmethod
    def of(cls, request: LabelRequest) -> Self:
        """Return a request without its frames."""
        return cls(request.episode, request.recording, request.sensor, request.model, request.job)


def request(episode: Episode, sensor: Sensor, model: str, ladder: Ladder) -> LabelRequest:
    """Return the request of an episode, from the recorded nominal path and not from the plan alone.

    Args:
        episode: The recording.
        sensor: The skin to label with.
        model: Content hash of the skin model.
        ladder: How the path's states are spaced.

    Raises:
        FormatError: If the recording has no frames or is no single vertical press into the skin.
    """
    time_ns = episode.taxels.sample_ns
    if not len(time_ns) or not len(episode.tip_ns):
        raise FormatError(
            f"{episode.path}: {len(time_ns)} taxel frames, {len(episode.tip_ns)} points of the nominal path",
            "a recording with both",
            "see `tacdata check`, or record this press again",
        )
    _check_known(episode, sensor)
    depth = episode.tip[:, 2]
    # The first frame at full depth: a hold belongs to the way up.
    peak = int(np.argmax(depth >= depth.max() - 1e-6))
    job = None
    if _settled_depth(episode) > 0:
        _check_path(episode, sensor, peak)
        x, y = _settled_place(episode)
        job = Job(
            sensor=sensor.content_hash,
            model=model,
            indenter=episode.press.indenter.document,
            x=x,
            y=y,
            yaw=float(episode.press.yaw),
            depths=ladder.depths(_settled_depth(episode), goes_up_otherwise(sensor.contact)),
            tolerance=ladder.tolerance,
            tilt_x=float(episode.press.tilt_x),
            tilt_y=float(episode.press.tilt_y),
        )
    return LabelRequest(
        episode=episode.number,
        recording=provenance.file_hash(episode.path),
        sensor=sensor,
        model=model,
        time_ns=time_ns,
        tip=episode.tip_at(time_ns),
        deepest_ns=int(episode.tip_ns[peak]),
        job=job,
    )


def _check_known(episode: Episode, sensor: Sensor) -> None:
    """Refuse imported recordings whose press or skin nobody described: their labels would be invented."""
    stand_ins = [text.split(":")[0] for text in episode.rig.get("imported", {}).get("stand_ins", [])]
    if sensor.content_hash != episode.sensor.content_hash:  # another file describes the skin
        stand_ins = [name for name in stand_ins if name.split("/")[0] in ("indenter", "contact") and name != "contact"]
    if stand_ins:
        raise FormatError(
            f"{episode.path}: imported without {', '.join(stand_ins)}",
            "a recording whose sensor, indenter and height of contact are known",
            "import it again with a mapping that names a sensor file, the indenter and contact "
            "(docs/how_to/foreign_data.md, labels)",
        )


def _settled_depth(episode: Episode) -> float:
    deepest, nominal = float(episode.tip[:, 2].max()), float(episode.press.depth)
    if abs(deepest - nominal) <= SAME_DEPTH:
        return round(nominal, 6)
    # Rounded up, so that no frame lies beyond the deepest state.
    return round(float(np.ceil(deepest / DEPTH_GRID - 1e-6)) * DEPTH_GRID, 6)


def _settled_place(episode: Episode) -> tuple[float, float]:
    place = episode.tip[episode.tip[:, 2] > 0, :2]
    nominal = np.array([episode.press.x, episode.press.y], dtype=float)
    if np.abs(place - nominal).max() <= SAME_PLACE:
        return round(float(nominal[0]), 6), round(float(nominal[1]), 6)
    centre = np.round(np.median(place, axis=0) / PLACE_GRID) * PLACE_GRID
    wander = float(np.linalg.norm(place - centre, axis=1).max())
    if wander > WANDER_LIMIT:
        raise FormatError(
            f"{episode.path}: the indenter wanders {wander:.2f} mm sideways in contact",
            f"at most {WANDER_LIMIT:g} mm: a label is solved for a vertical press",
            "record this press again without moving sideways",
        )
    return round(float(centre[0]), 6), round(float(centre[1]), 6)


def _check_path(episode: Episode, sensor: Sensor, peak: int) -> None:
    depth = np.maximum(episode.tip[:, 2], 0.0)
    if depth.max() >= sensor.skin.thickness:
        raise FormatError(
            f"{episode.path}: pressed {depth.max():.2f} mm deep, the skin of {sensor.name} is "
            f"{sensor.skin.thickness:g} mm thick",
            f"less than {sensor.skin.thickness:g} mm",
            "check the registration of the rig, or label with the right sensor file",
        )
    rising, falling = depth[: peak + 1], depth[peak:][::-1]
    reload = max(float((np.maximum.accumulate(branch) - branch).max()) for branch in (rising, falling))
    if reload > RELOAD_LIMIT:
        raise FormatError(
            f"{episode.path}: the depth falls and rises again by {reload:.2f} mm",
            f"one press: down, hold, up (within {RELOAD_LIMIT:g} mm)",
            "record each press as an episode of its own",
        )
