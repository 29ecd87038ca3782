"""Reads a recorded demonstration as arrays, from a finished or a damaged file."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log

from tacdata.demonstrations.recording.rig import DemoRig, demo_rig_of
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.clocks.envelope_fit import fit
from tacdata.recording.clocks.image_clock import ImageClock
from tacdata.recording.clocks.running_clock import nominal_period_ns
from tacdata.recording.episode import TagStream, TaxelStream
from tacdata.recording.files import topics
from tacdata.recording.files.camera_arrays import clock_of, finger_streams
from tacdata.recording.files.mcap_records import Records, counted, read_records
from tacdata.schemas import tacdata_pb2 as pb

UNTIMED = 0.02
"""Standard uncertainty of an image's time without a clock model, in a damaged file [s]."""


TIMELY = 0.02
"""Largest standard uncertainty of an image's time with which it is used for motion, cameras and tags [s]."""
NEARLY_ALL = 0.99
"""Share of a camera's images that must be that well timed [1]."""


@dataclass(frozen=True)
class DemoRecording:
    """One demonstration, on the host's clock."""

    path: Path
    rig: DemoRig
    task: str
    taxels: dict[str, TaxelStream]
    """Finger -> its board's raw readings; fingers without board are missing."""
    views: tuple[TagStream, ...]
    """Poses of fingertips in the cameras' frames, one stream per camera and finger."""
    complete: bool
    """False if the recording was interrupted or salvaged."""
    notes: tuple[str, ...]
    """Remarks of the recorder and of the reader, as sentences."""
    timing: dict[str, float] = field(default_factory=dict)
    """Camera -> standard uncertainty of its image times [s], beyond that of each image."""
    searched: str = "images that the recorder had time for"
    """Which images were searched for tags, in words."""

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last time of any data [ns]."""
        times = [s.sample_ns for s in (*self.taxels.values(), *self.views) if len(s.sample_ns)]
        return (min(int(t[0]) for t in times), max(int(t[-1]) for t in times)) if times else (0, 0)


def read_demo(path: StrPath) -> DemoRecording:
    """Read one demonstration.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is not a demonstration, or was cut off before its attachments.
    """
    records = read_records(Path(path), images=False)
    try:
        return _recording(records)
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(
            f"{path}: a recording with unexpected content ({type(error).__name__}: {error})",
            "a demonstration recorded by this release of tacdata",
            "use the release that wrote it",
        ) from error


def times_known(path: Path) -> dict[str, float]:
    """Return camera -> standard uncertainty of nearly all of its images' times [s]; those with few images are missing.

    Args:
        path: A demonstration; raises as `read_demo`.
    """
    records = read_records(Path(path), images=False)
    cameras = _attachment(records, "demo_rig.json")["cameras"]
    clocks = {name: clock_of(records, name, entry.get("rate")) for name, entry in cameras.items()}
    return {
        name: float(np.quantile(clock.uncertainty, NEARLY_ALL))
        for name, clock in clocks.items()
        if isinstance(clock, ImageClock)
    }


def _recording(records: Records) -> DemoRecording:
    rig = demo_rig_of(_attachment(records, "demo_rig.json"), f"{records.path}: demo_rig.json")
    boards = _attachment(records, "boards.json")
    rate = rig.clock.rate if "clock" in rig.document else 1.0
    end = records.metadata.get("episode", {})
    logged = (Log.FromString(message.data) for message in records.of_topic(topics.LOG))
    notes = [*counted(records.damage), *((end["reason"],) if end.get("reason") else ())]
    notes += [entry.message for entry in logged if entry.level > Log.Level.INFO]
    views, timing = [], {}
    for camera in rig.cameras:
        clock = clock_of(records, camera, rig.cameras[camera].get("rate"))
        views += finger_streams(records, camera, clock)
        timing[camera] = _timing(clock)
    return DemoRecording(
        records.path,
        rig,
        _attachment(records, "task.json")["task"],
        {name: _taxels(records, name, boards[name], rate, rig.sensors[name].taxels.count) for name in rig.boards},
        tuple(views),
        bool(json.loads(end.get("complete", "false"))) and not records.damage,
        tuple(notes),
        timing,
    )


def _timing(clock: ImageClock | ClockModel | None) -> float:
    """Return the uncertainty common to a camera's image times [s]; 0 where each image has its own."""
    if clock is None:
        return UNTIMED
    if isinstance(clock, ImageClock):
        return 0.0
    latency = clock.latency.uncertainty_ns if clock.latency else 0
    return float(np.hypot(clock.uncertainty_ns if clock.steady else clock.jitter_ns, latency)) * 1e-9


def _attachment(records: Records, name: str) -> Any:
    if name not in records.attachments:
        press = "press.json" in records.attachments
        raise FormatError(
            f"{records.path} is a recording of a press" if press else f"{records.path} holds no {name}",
            "a recording made by tacdata record --demo",
            "tacdata check, label and pack are for presses" if press else "nothing of it can be restored",
        )
    return json.loads(records.attachments[name].data)


def _taxels(records: Records, name: str, board: dict[str, Any], rate: float, count: int) -> TaxelStream:
    frames = [pb.Taxels.FromString(message.data) for message in records.of_topic(topics.taxels(name))]
    widths = {len(frame.counts) for frame in frames} - {count}
    if widths:
        raise FormatError(
            f"{records.path}: {name}: frames of {sorted(widths)[0]} channels",
            f"{count}, as {name}'s sensor says",
            "name the sensor file of that board in the demo rig",
        )
    arrival, counter, device = (
        np.array([getattr(frame, field) for frame in frames], np.int64)
        for field in ("arrival_ns", "counter", "device_ns")
    )
    axis = device if board.get("clock") == "device_ns" else counter
    stored = records.metadata.get(f"clock_model/taxels {name}")
    kind = "device_ns" if board.get("clock") == "device_ns" else "counter"
    # Clock models are written at the end: a file that was cut off has none.
    model = ClockModel.from_document(stored) if stored else fit(arrival, axis, kind, rate, nominal_period_ns(board))
    sample = arrival if model is None else model.sample_times(arrival, axis)
    counts = np.array([list(frame.counts) for frame in frames], float).reshape(-1, count)
    return TaxelStream(arrival, sample, counter, counts, device)
