"""A recording as an `Episode`, from a finished file or from what a crash left."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from schemas import tacdata_pb2 as pb
from tacdata.errors import FormatError
from tacdata.plans import Press
from tacdata.recording import anchoring, channels, clock_model
from tacdata.recording.anchoring import AnchoredMove, Command, StatusTimes
from tacdata.recording.episode import CncStream, Episode, TagStream, TaxelStream
from tacdata.recording.mcap_records import Records, read_records
from tacdata.recording.motion_profile import AxisLimits
from tacdata.rig import Registration
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Recording:
    """An episode with what only `tacdata check` and curious people ask for."""

    episode: Episode
    moves: tuple[AnchoredMove, ...]
    """Every move with its anchored start and uncertainty."""
    counts: dict[str, dict[str, Any]]
    """Stream name -> received, lost, repeated, corrupt, garbage_bytes, notes, as the drivers counted."""
    plan: dict[str, Any]
    """The plan's document."""
    board: dict[str, Any]
    """The board's description of itself."""
    images: dict[str, int]
    """Camera name -> images in the file."""
    log: tuple[str, ...]
    """Warnings and errors noted while recording."""


def read_episode(path: Path) -> Episode:
    """Read one recording; a file without its end is salvaged without being asked.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is foreign, or broke off before its attachments.
    """
    return read_recording(path).episode


def read_recording(path: Path) -> Recording:
    """Read one recording with everything in it. Raises as `read_episode`."""
    records = read_records(Path(path))
    try:
        return _recording(records)
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(
            f"{path}: a recording with unexpected content ({type(error).__name__}: {error})",
            "a file recorded by this release of tacdata",
            "use the release that wrote it",
        ) from error


def _recording(records: Records) -> Recording:
    press = Press.from_document(_attachment(records, "press.json"), str(records.path))
    sensor = Sensor.from_document(_attachment(records, "sensor.json"), f"{records.path}: sensor.json")
    rig, controller = _attachment(records, "rig.json"), _attachment(records, "controller.json")
    end = records.metadata.get("episode", {})
    complete = json.loads(end.get("complete", "false")) and not records.damage
    statuses = _statuses(records)
    commands = [_command(message.data) for message in records.of_topic(channels.MOTION)]
    limits = AxisLimits(np.array(controller["acceleration"], float), np.array(controller["max_rate"], float))
    moves = anchoring.anchor(commands, statuses, limits)
    tip_ns, machine = anchoring.machine_path(moves, statuses.stream, complete)
    registration = Registration(tuple(rig["registration"]["origin"]), rig["registration"]["yaw"])
    log = tuple(
        entry.message for entry in map(_log, records.of_topic(channels.LOG)) if entry.level > Log.Level.INFO
    )
    cameras = [t.split("/")[2] for t in (c.topic for c in records.channels.values()) if t.endswith("/image")]
    episode = Episode(
        path=records.path,
        press=press,
        sensor=sensor,
        rig=rig,
        taxels=_taxels(records, sensor.taxels.count),
        cnc=statuses.stream,
        tags=tuple(
            _tags(records, camera) for camera in cameras if rig.get("cameras", {}).get(camera, {}).get("cube")
        ),
        phases=anchoring.phases(commands, moves),
        tip_ns=tip_ns,
        tip=registration.to_sensor(machine),
        complete=bool(complete),
        notes=_notes(records, end, moves, log),
    )
    counts = {
        name.removeprefix("stream_counts/"): {key: json.loads(value) for key, value in values.items()}
        for name, values in records.metadata.items()
        if name.startswith("stream_counts/")
    }
    images = {camera: len(records.of_topic(channels.image(camera))) for camera in cameras}
    return Recording(
        episode,
        tuple(moves),
        counts,
        _attachment(records, "plan.json"),
        _attachment(records, "board.json"),
        images,
        log,
    )


def _attachment(records: Records, name: str) -> Any:
    if name not in records.attachments:
        raise FormatError(
            f"{records.path} holds no {name}" + (f" ({records.damage[0]})" if records.damage else ""),
            "a recording of tacdata with its attachments",
            "nothing of it can be restored"
            if records.damage
            else "this MCAP file comes from another program",
        )
    return json.loads(records.attachments[name].data)


def _notes(
    records: Records, end: dict[str, str], moves: list[AnchoredMove], log: tuple[str, ...]
) -> tuple[str, ...]:
    notes = [*records.damage]
    if not end:
        notes.append("the recording was never closed; everything up to its last chunk is here")
    elif end.get("reason"):
        notes.append(end["reason"])
    clashes = [move.contradiction_ns for move in moves if move.contradiction_ns > 0]
    if clashes:
        notes.append(f"status reports contradict the commanded profile by up to {max(clashes) / 1e6:.0f} ms")
    return (*notes, *log)


def _log(message: Any) -> Log:
    return Log.FromString(message.data)


def _array(values: list[int]) -> np.ndarray:
    return np.array(values, dtype=np.int64)


def _taxels(records: Records, count: int) -> TaxelStream:
    frames = [pb.Taxels.FromString(message.data) for message in records.of_topic(channels.TAXELS)]
    arrival, counter = _array([f.arrival_ns for f in frames]), _array([f.counter for f in frames])
    stored = records.metadata.get("clock_model/taxels")
    model = clock_model.ClockModel.from_document(stored) if stored else clock_model.fit(arrival, counter)
    sample = arrival if model is None else np.where(counter >= 0, model.sample_ns(counter), arrival)
    widths = {len(f.counts) for f in frames}
    if widths - {count}:
        raise FormatError(
            f"{records.path}: frames of {', '.join(map(str, sorted(widths)))} channels",
            f"{count} channels, as its sensor description says",
            "record with the sensor file that belongs to the board",
        )
    counts = np.array([list(f.counts) for f in frames], dtype=float).reshape(-1, count)
    return TaxelStream(arrival, sample, counter, counts)


def _statuses(records: Records) -> StatusTimes:
    reports = [pb.CncStatus.FromString(message.data) for message in records.of_topic(channels.STATUS)]
    sent, arrival = _array([r.sent_ns for r in reports]), _array([r.arrival_ns for r in reports])
    position = np.array([[r.position.x, r.position.y, r.position.z] for r in reports], dtype=float).reshape(
        -1, 3
    )
    stream = CncStream(arrival, (sent + arrival) // 2, position, tuple(r.state for r in reports))
    return StatusTimes(sent, stream)


def _command(data: bytes) -> Command:
    m = pb.Motion.FromString(data)
    start, target = (np.array([v.x, v.y, v.z]) for v in (m.start, m.target))
    return Command(m.phase, start, target, m.speed, m.dwell, m.sent_ns, m.acknowledged_ns, m.line)


def _tags(records: Records, camera: str) -> TagStream:
    views = [pb.CubeView.FromString(message.data) for message in records.of_topic(channels.cube(camera))]
    poses = {m.sequence: PoseInFrame.FromString(m.data).pose for m in records.of_topic(channels.pose(camera))}
    position, quaternion = np.full((len(views), 3), np.nan), np.full((len(views), 4), np.nan)
    for row, view in enumerate(views):
        pose = poses.get(view.sequence & 0xFFFFFFFF)
        if pose is not None:
            p, q = pose.position, pose.orientation
            position[row], quaternion[row] = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
    reprojection = np.array([v.reprojection if v.faces else np.nan for v in views], dtype=float)
    return TagStream(
        camera,
        _array([v.sample_ns for v in views]),
        position,
        quaternion,
        reprojection,
        _array([v.faces for v in views]),
    )
