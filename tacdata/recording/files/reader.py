"""Reads a recording as an `Episode`, from a finished or a damaged file."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log

from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.plans import Press
from tacdata.recording.clocks.clock_model import ClockModel, StreamLatency
from tacdata.recording.clocks.envelope_fit import fit
from tacdata.recording.clocks.running_clock import nominal_period_ns
from tacdata.recording.episode import CncStream, Episode, TaxelStream
from tacdata.recording.files import topics
from tacdata.recording.files.camera_arrays import ImageTimes, cube_stream, finger_streams, image_stamps, image_times
from tacdata.recording.files.mcap_records import Records, counted, read_records
from tacdata.recording.files.quantities import marked_phases, measured_streams
from tacdata.recording.files.taxel_arrays import TaxelFrames, taxel_frames
from tacdata.recording.motion import move_times
from tacdata.recording.motion.move_times import AnchoredMove, Command, StatusTimes
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.rig import registration_for
from tacdata.schemas import tacdata_pb2 as pb
from tacdata.sensor import Sensor


@dataclass(frozen=True)
class Recording:
    """An episode with all that `tacdata check` needs beyond it."""

    episode: Episode
    moves: tuple[AnchoredMove, ...]
    """Every move with its estimated start and uncertainty."""
    counts: dict[str, dict[str, Any]]
    """Stream name -> received, lost, repeated, corrupt, garbage_bytes, notes, as the drivers counted."""
    plan: dict[str, Any]
    """The plan's document."""
    board: dict[str, Any]
    """The board's description of itself."""
    images: dict[str, int]
    """Camera name -> images in the file."""
    log: tuple[str, ...]
    """Warnings and errors logged while recording."""
    clocks: dict[str, ClockModel]
    """Stream name ("taxels", "camera NAME") -> its clock, as stored or fitted again."""
    cameras: dict[str, ImageTimes]
    """Camera name -> its images' times."""
    polled: dict[str, str]
    """The motion controller's clock, as stored (`polled_clock`)."""
    height_resolution: float
    """Largest difference between reported and commanded height at rest [mm]."""


def read_episode(path: StrPath) -> Episode:
    """Read one recording as an `Episode`; a file that a crash cut off is salvaged.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is not a recording, or was cut off before its attachments.

    Example:
        >>> import tacdata as td
        >>> episode = td.read_episode("session/episode-000000.mcap")
        >>> episode.taxels.counts.shape  # frames, taxels
        (170, 24)
        >>> episode.press.indenter
        Sphere(radius=3.0)
    """
    path = Path(path)
    return read_recording(path).episode


def read_recording(
    path: StrPath, digests: bool = True, seen: Callable[[str, memoryview], None] | None = None
) -> Recording:
    """Read one recording with everything in it, also the parts that `Episode` leaves out.

    Args:
        path: The file.
        digests: Whether to compute a checksum of each picture (`ImageTimes.digest`); reading is faster without.
        seen: Takes the topic and message of each picture as it is read (`mcap_records.read_records`).

    Raises:
        UsageError: As `read_episode`.
        FormatError: As `read_episode`.
    """
    return recording_of(read_records(Path(path), images=False, digests=digests, seen=seen))


def recording_of(records: Records) -> Recording:
    """Return the recording that a file's records hold, also of one that is still being written; raises as
    `read_episode`.
    """
    try:
        return _recording(records)
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(
            f"{records.path}: a recording with unexpected content ({type(error).__name__}: {error})",
            "a file recorded by this release of tacdata",
            "use the release that wrote it",
        ) from error


def _recording(records: Records) -> Recording:
    press = Press.from_document(_attachment(records, "press.json"), str(records.path))
    sensor = Sensor.from_document(_attachment(records, "sensor.json"), f"{records.path}: sensor.json")
    rig, controller = _attachment(records, "rig.json"), _attachment(records, "controller.json")
    end = records.metadata.get("episode", {})
    # A file is never complete by its own word alone: damage can lie in what it does not know of.
    complete = bool(json.loads(end.get("complete", "false"))) and not records.damage
    # The path is computed, not measured: commands say where, reports and acknowledgements say when.
    statuses = _statuses(records)
    commands = [_command(message.data) for message in records.of_topic(topics.MOTION)]
    limits = AxisLimits(np.array(controller["acceleration"], float), np.array(controller["max_rate"], float))
    resolution = move_times.report_resolution(controller.get("settings", {}))
    moves = move_times.anchor(commands, statuses, limits, resolution)
    tip_ns, machine = move_times.machine_path(moves, statuses.stream, complete)
    # The path so far is in machine axes; the registration takes it to the sensor's frame.
    registration = registration_for(rig, press.indenter_name)
    log = tuple(entry.message for entry in map(_log, records.of_topic(topics.LOG)) if entry.level > Log.Level.INFO)
    cameras = [t.split("/")[2] for t in (c.topic for c in records.channels.values()) if t.endswith("/image")]
    frames = taxel_frames(records.columns_of(topics.TAXELS).data)
    clocks = _clocks(records, frames, cameras, float(rig.get("clock", {}).get("rate", 1.0)))
    episode = Episode(
        path=records.path,
        press=press,
        sensor=sensor,
        rig=rig,
        taxels=_taxels(records.path, frames, sensor.taxels.count, clocks.get("taxels")),
        cnc=statuses.stream,
        tags=tuple(
            cube_stream(records, camera, clocks.get(f"camera {camera}"))
            for camera in cameras
            if rig.get("cameras", {}).get(camera, {}).get("cube")
        ),
        phases=move_times.phases(commands, moves) if commands else marked_phases(records),
        tip_ns=tip_ns,
        tip=registration.to_sensor(machine),
        complete=complete,
        notes=_notes(records, complete, moves, log),
        measured=measured_streams(records),
        fingers=tuple(stream for c in cameras for stream in finger_streams(records, c, clocks.get(f"camera {c}"))),
    )
    counts = {
        name.removeprefix("stream_counts/"): {key: json.loads(value) for key, value in values.items()}
        for name, values in records.metadata.items()
        if name.startswith("stream_counts/")
    }
    images = {camera: len(records.columns_of(topics.image(camera)).data) for camera in cameras}
    return Recording(
        episode,
        tuple(moves),
        counts,
        _attachment(records, "plan.json"),
        _attachment(records, "board.json"),
        images,
        log,
        clocks,
        {camera: image_times(records, camera, clocks.get(f"camera {camera}")) for camera in cameras},
        records.metadata.get("clock_model/cnc", {}),
        float(resolution[2]),
    )


def _attachment(records: Records, name: str) -> Any:
    if "demo_rig.json" in records.attachments:
        raise FormatError(
            f"{records.path} is a demonstration by hand", "a recording of a press", "process it with tacdata track"
        )
    if name not in records.attachments:
        raise FormatError(
            f"{records.path} holds no {name}" + (f" ({records.damage[0]})" if records.damage else ""),
            "a recording of tacdata with its attachments",
            "nothing of it can be restored" if records.damage else "this MCAP file comes from another program",
        )
    return json.loads(records.attachments[name].data)


def _notes(records: Records, complete: bool, moves: list[AnchoredMove], log: tuple[str, ...]) -> tuple[str, ...]:
    notes, end = counted(records.damage), records.metadata.get("episode", {})
    if not end:
        notes.append("the recording was never closed; everything up to its last chunk is here")
    elif end.get("reason"):
        notes.append(end["reason"])
    # An interrupted move (a hold, an alarm) did not run to its end: nothing contradicts its profile.
    judged = moves if complete else moves[:-1]
    clashes = [move.contradiction_ns for move in judged if move.contradiction_ns > 0]
    if clashes:
        notes.append(f"status reports contradict the commanded profile by up to {max(clashes) / 1e6:.0f} ms")
    return (*notes, *log)


def _log(message: Any) -> Log:
    return Log.FromString(message.data)


def _array(values: list[int]) -> np.ndarray:
    return np.array(values, dtype=np.int64)


def _clocks(records: Records, frames: TaxelFrames, cameras: list[str], rate: float) -> dict[str, ClockModel]:
    """Return each stream's clock: as stored, or fitted again to the frames before a crash."""
    clocks = {}
    for name in ("taxels", *(f"camera {camera}" for camera in cameras)):
        stored = records.metadata.get(f"clock_model/{name}")
        model = ClockModel.from_document(stored) if stored else _fitted(records, frames, name, rate)
        if model is not None:
            clocks[name] = model
    return clocks


def _fitted(records: Records, frames: TaxelFrames, stream: str, rate: float) -> ClockModel | None:
    attached = records.attachments.get("latencies.json")
    latency = json.loads(attached.data).get(stream) if attached else None
    if stream == "taxels":
        board = _attachment(records, "board.json")
        axis = "device_ns" if board.get("clock") == "device_ns" else "counter"
        model = fit(frames.arrival_ns, getattr(frames, axis), axis, rate, nominal_period_ns(board))
    else:
        arrival, sequence, device = image_stamps(records, stream.removeprefix("camera "))
        on_device = len(device) > 0 and bool((device >= 0).all())
        # An image without a stamp has only the number that it was given on arrival.
        model = fit(arrival, device if on_device else sequence, "device_ns" if on_device else "order", rate)
    return model.with_latency(StreamLatency.from_document(latency)) if model and latency else model


def _taxels(path: Path, frames: TaxelFrames, count: int, clock: ClockModel | None) -> TaxelStream:
    arrival, counter, device = frames.arrival_ns, frames.counter, frames.device_ns
    on_device = clock is not None and clock.axis == "device_ns"
    sample = arrival if clock is None else clock.sample_times(arrival, device if on_device else counter)
    if set(frames.widths) - {count}:
        raise FormatError(
            f"{path}: frames of {', '.join(map(str, frames.widths))} channels",
            f"{count} channels, as its sensor description says",
            "record with the sensor file that belongs to the board",
        )
    return TaxelStream(arrival, sample, counter, frames.counts.reshape(-1, count), device)


def _statuses(records: Records) -> StatusTimes:
    reports = [pb.CncStatus.FromString(message.data) for message in records.of_topic(topics.STATUS)]
    sent, arrival = _array([r.sent_ns for r in reports]), _array([r.arrival_ns for r in reports])
    position = np.array([[r.position.x, r.position.y, r.position.z] for r in reports], dtype=float).reshape(-1, 3)
    stream = CncStream(arrival, (sent + arrival) // 2, position, tuple(r.state for r in reports))
    return StatusTimes(sent, stream)


def _command(data: bytes) -> Command:
    m = pb.Motion.FromString(data)
    start, target = (np.array([v.x, v.y, v.z]) for v in (m.start, m.target))
    return Command(m.phase, start, target, m.speed, m.dwell, m.sent_ns, m.acknowledged_ns, m.line)
