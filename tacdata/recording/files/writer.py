"""Writes one press to one MCAP file, from any thread; kill -9 costs at most the last second.

While it is written the file is called ``*.partial.mcap``. Closed complete, it gets its final name. Closed after a
fault, it becomes ``*.interrupted-K.mcap``. Under any name, all that reached the disk can be read.
"""

from __future__ import annotations

import json
import queue
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts, TaxelFrame
from tacdata.errors import DeviceError, UsageError
from tacdata.plans import Press
from tacdata.recording.clocks.clock_model import ClockModel, StreamLatency
from tacdata.recording.clocks.polled_clock import PolledClock
from tacdata.recording.clocks.stream_pairs import stream_pairs
from tacdata.recording.files import file_names, topics
from tacdata.recording.files.chunked_file import ChunkedFile
from tacdata.recording.motion.move_times import Command
from tacdata.schemas import tacdata_pb2 as pb
from tacdata.sensor import Sensor

WAITING = 256_000_000
"""Bytes that may wait for the disk; more means that it cannot keep up [bytes]."""
LEVELS = {"info": Log.Level.INFO, "warning": Log.Level.WARNING, "error": Log.Level.ERROR}


@dataclass(frozen=True)
class Header:
    """The documents that are attached to every recording."""

    press: Press
    sensor: Sensor
    rig: dict[str, Any]
    """The rig file's document."""
    plan: dict[str, Any]
    """The plan file's document."""
    board: dict[str, Any] = field(default_factory=dict)
    """The board's description of itself: channels, frame format, units, nominal rate."""
    controller: dict[str, Any] = field(default_factory=dict)
    """``settings`` as read, ``acceleration`` [mm/s^2] and ``max_rate`` [mm/s] of each axis."""
    latencies: dict[str, StreamLatency] = field(default_factory=dict)
    """Constant latency of each stream, measured by a sync tap, by the stream's name."""

    @property
    def attachments(self) -> dict[str, Any]:
        """Name of each attachment and its document."""
        return {
            "press.json": self.press.document,
            "sensor.json": self.sensor.document,
            "rig.json": self.rig,
            "registration.json": self.rig.get("registration", {}),
            "plan.json": self.plan,
            "board.json": self.board,
            "controller.json": self.controller,
            "latencies.json": {name: latency.document for name, latency in self.latencies.items()},
        }


@dataclass(frozen=True)
class CubePoseRecord:
    """Pose of a cube, or of the fingertip that carries it, as detected."""

    position: tuple[float, float, float]
    """Origin of the cube or tip in the camera frame [m]."""
    quaternion: tuple[float, float, float, float]
    """Orientation of the cube or tip in the camera frame, xyzw [1]."""
    reprojection: float
    """Reprojection error, root mean square [px]."""
    faces: int
    """Faces seen [count]."""
    ids: tuple[int, ...] = ()
    """Tags read on the cube, ascending."""
    ambiguous: bool = False
    """Whether a second pose explains the image about as well."""
    covariance: tuple[float, ...] = ()
    """Covariance of a small rotation in the camera frame [rad] and the position [m], 6 x 6 by rows; empty if unknown.
    """
    strays: tuple[int, ...] = ()
    """Outlier tags: tags of this cube that the pose does not explain."""


class Attached(Protocol):
    """Anything that lists documents to attach to a recording."""

    @property
    def attachments(self) -> dict[str, Any]:
        """Name of each attachment and its document."""
        ...


class EpisodeWriter:
    """A recording in progress. Thread-safe; a thread of its own writes."""

    def __init__(
        self,
        path: Path,
        header: Attached,
        clock: Clock,
        cameras: tuple[str, ...] = (),
        fingers: tuple[str, ...] = (),
        boards: tuple[str, ...] = (),
    ) -> None:
        """Create the file under its partial name and write the attachments.

        Args:
            path: The finished file's name.
            header: Attachments.
            clock: The recording's clock.
            cameras: Names of the cameras.
            fingers: Names of the fingers that cameras may look at.
            boards: Names of the boards, if there are several.

        Raises:
            UsageError: If a recording of that name, finished or partial, exists.
            DeviceError: If the disk refuses it.
        """
        if path.exists():
            raise UsageError(f"{path} exists", "a recording is never overwritten", "choose another session folder")
        self.path, self._clock = path, clock
        taxels = [f"taxels {board}" for board in boards] or ["taxels"]
        self._streams = [*taxels, *(f"camera {camera}" for camera in cameras)]
        self._moves = "controller.json" in header.attachments
        self.begun_ns = clock.now_ns()
        """Host time of creation [ns]; earlier arrivals belong to no recording or to the one before."""
        try:
            self._file = _begun(path, header, clock, cameras, fingers, boards)
        except OSError as error:
            raise DeviceError(
                f"{path} cannot be begun: {error}", "a disk with room for the recording", "make room, then --resume"
            ) from error
        self._queue: queue.SimpleQueue[tuple[str, int, int, int, bytes] | None] = clock.host.queue()
        self._taken = self._written = 0  # bytes received and bytes written
        self._failure: Exception | None = None
        self._lock = clock.host.lock()
        self._thread = clock.host.thread(self._drain, f"write {path.name}")
        self.note("recording begins")
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """The error that stopped the writing (a full disk, for example), or None."""
        return self._failure

    @property
    def waiting(self) -> int:
        """Bytes that wait to be written."""
        with self._lock:
            return self._taken - self._written

    def _drain(self) -> None:
        while True:
            try:
                item = self._queue.get(timeout=0.1)
            except queue.Empty:
                item = ()
            if item is None:
                return
            try:
                # Without messages, too, the chunk has to be closed at its age.
                if self._failure is None:
                    self._file.add(*item) if item else self._file.tick()
            except Exception as error:  # any error of writing stops the motion
                self._failure = error
            if item:
                self._written += len(item[-1])

    def _add(self, topic: str, log_ns: int, publish_ns: int, sequence: int, message: Any) -> None:
        data = message.SerializeToString()
        with self._lock:
            self._taken += len(data)
            # A disk that is too slow would fill the memory until the system kills the recorder, and with it the last
            # second.
            waiting = self._taken - self._written
        if self._failure is None and waiting > WAITING:
            self._failure = OSError(f"the disk is slower than the streams: {waiting / 1e6:.0f} MB wait to be written")
        if self._failure is None:
            self._queue.put((topic, log_ns, publish_ns, sequence, data))

    def taxels(self, frame: TaxelFrame, sample_ns: int, board: str = "") -> None:
        """Write one frame of the board, or of one of several, with its estimated sample time [ns]."""
        message = pb.Taxels(
            arrival_ns=frame.arrival_ns,
            sample_ns=sample_ns,
            counter=frame.counter,
            counts=frame.counts.tolist(),
            device_ns=frame.device_ns,
        )
        self._add(topics.taxels(board), frame.arrival_ns, sample_ns, max(frame.counter, 0), message)

    def status(self, status: CncStatus) -> None:
        """Write one status report; its sample time is the middle of query and answer."""
        x, y, z = (float(value) for value in status.position)
        message = pb.CncStatus(
            sent_ns=status.sent_ns,
            arrival_ns=status.arrival_ns,
            state=status.state,
            position=pb.Vector3(x=x, y=y, z=z),
            feed=status.feed,
        )
        self._add(topics.STATUS, status.arrival_ns, (status.sent_ns + status.arrival_ns) // 2, 0, message)

    def motion(self, command: Command) -> None:
        """Write one acknowledged command."""
        message = pb.Motion(
            line=command.line,
            sent_ns=command.sent_ns,
            acknowledged_ns=command.acknowledged_ns,
            phase=command.phase,
            start=pb.Vector3(**dict(zip("xyz", command.start.tolist(), strict=True))),
            target=pb.Vector3(**dict(zip("xyz", command.target.tolist(), strict=True))),
            speed=command.speed,
            dwell=command.dwell,
        )
        self._add(topics.MOTION, command.acknowledged_ns, command.sent_ns, 0, message)

    def phase(self, name: str, start_ns: int) -> None:
        """Mark the beginning of a phase; an empty name ends the current one."""
        self._add(topics.PHASE, start_ns, start_ns, 0, pb.Phase(name=name, start_ns=start_ns))

    def image(
        self, camera: str, arrival_ns: int, sample_ns: int, sequence: int, jpeg: bytes, device_ns: int = -1
    ) -> None:
        """Write one compressed image and its times."""
        message = CompressedImage(frame_id=camera, data=jpeg, format="jpeg")
        message.timestamp.FromNanoseconds(sample_ns)
        time = pb.ImageTime(arrival_ns=arrival_ns, sample_ns=sample_ns, sequence=sequence, device_ns=device_ns)
        self._add(topics.image_time(camera), arrival_ns, sample_ns, sequence, time)
        self._add(topics.image(camera), arrival_ns, sample_ns, sequence, message)

    def cube(
        self, camera: str, arrival_ns: int, sample_ns: int, sequence: int, pose: CubePoseRecord | None, finger: str = ""
    ) -> None:
        """Write the detection of the cube, or of a finger, in one image; ``None`` if no face was seen."""
        pair = topics.finger(camera, finger) if finger else (topics.cube(camera), topics.pose(camera))
        stamps = arrival_ns, sample_ns, sequence
        if pose is not None:
            self._add(pair[1], *stamps, _pose_message(camera, sample_ns, pose))
        self._add(pair[0], *stamps, _view_message(stamps, pose))

    def note(self, text: str, level: str = "info") -> None:
        """Write a remark for a person."""
        now_ns = self._clock.now_ns()
        self._add(topics.LOG, now_ns, now_ns, 0, self._log_message(text, level))

    def _log_message(self, text: str, level: str) -> Log:
        message = Log(level=LEVELS[level], message=text, name="tacdata")
        message.timestamp.FromNanoseconds(self._clock.now_ns())
        return message

    def close(
        self,
        complete: bool,
        reason: str = "",
        clock_models: dict[str, ClockModel | PolledClock] | None = None,
        counts: dict[str, StreamCounts] | None = None,
    ) -> Path:
        """Finish the file and rename it.

        Args:
            complete: Whether the press was carried out and recorded completely.
            reason: Why not, as a sentence.
            clock_models: Clock model of each stream, by its name ("taxels").
            counts: Frames received and lost by each stream.

        Returns:
            The file's path: the final one, or that of an interrupted recording.

        Raises:
            DeviceError: If the disk refused something; the message names the file that holds the data so far.
        """
        # Behind all that waits: the thread writes everything before it ends.
        self._queue.put(None)
        self._thread.join()
        # Only a complete recording gets the name of an episode.
        target = self.path if complete and self._failure is None else file_names.next_interrupted(self.path)
        try:
            if self._failure is not None:
                raise self._failure
            for name, model in (clock_models or {}).items():
                self._file.describe(f"clock_model/{name}", model.document)
            latencies = {k: m.latency for k, m in (clock_models or {}).items() if isinstance(m, ClockModel)}
            pairs = stream_pairs({**dict.fromkeys(self._streams), **latencies}, self._moves)
            self._file.describe("sync", {pair.name: pair.words for pair in pairs})
            for name, count in (counts or {}).items():
                self._file.describe(f"stream_counts/{name}", {k: json.dumps(v) for k, v in vars(count).items()})
            self._file.describe("episode", {"complete": json.dumps(complete), "reason": reason})
            self._file.close()
        except Exception as error:  # any error of writing is reported, and the file closed
            self._file.let_go()
            partial = self._file.path
            raise DeviceError(
                f"writing {partial} failed: {error}",
                "a disk with room for the recording",
                f"make room, then continue with --resume; what was written stays readable in {partial.name}",
            ) from error
        self._file.path.rename(target)
        return target


def _pose_message(frame: str, sample_ns: int, pose: CubePoseRecord) -> PoseInFrame:
    (x, y, z), (qx, qy, qz, qw) = pose.position, pose.quaternion
    message = PoseInFrame(frame_id=frame)
    message.timestamp.FromNanoseconds(sample_ns)
    message.pose.position.x, message.pose.position.y, message.pose.position.z = float(x), float(y), float(z)
    turn = message.pose.orientation
    turn.x, turn.y, turn.z, turn.w = float(qx), float(qy), float(qz), float(qw)
    return message


def _view_message(stamps: tuple[int, int, int], pose: CubePoseRecord | None) -> pb.CubeView:
    view = pb.CubeView(arrival_ns=stamps[0], sample_ns=stamps[1], sequence=stamps[2])
    if pose is not None:
        view.faces, view.reprojection, view.ambiguous = pose.faces, pose.reprojection, pose.ambiguous
        view.ids.extend(pose.ids)
        view.covariance.extend(pose.covariance)
        view.strays.extend(pose.strays)
    return view


def _begun(
    path: Path,
    header: Attached,
    clock: Clock,
    cameras: tuple[str, ...],
    fingers: tuple[str, ...],
    boards: tuple[str, ...],
) -> ChunkedFile:
    """Create the file with its channels and attachments and sync it to the disk."""
    file = ChunkedFile(file_names.partial(path), host=clock.host)
    for topic, message in topics.FIXED.items():
        file.register(topic, message)
    for board in boards:
        file.register(topics.taxels(board), pb.Taxels)
    for camera in cameras:
        for topic, message in topics.of_camera(camera, fingers).items():
            file.register(topic, message)
    try:
        for name, document in header.attachments.items():
            file.attach(name, "application/json", json.dumps(document, indent=1).encode(), clock.now_ns())
        file.flush()
    except OSError:
        file.let_go()
        file.path.unlink(missing_ok=True)  # without its attachments nobody can read it
        raise
    return file
