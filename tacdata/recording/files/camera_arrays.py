"""Camera channels of a recording as arrays: image times, cube poses, fingertip poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.clocks.image_clock import ImageClock, image_clock
from tacdata.recording.episode import TagStream
from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import Records
from tacdata.schemas import tacdata_pb2 as pb


@dataclass(frozen=True)
class ImageTimes:
    """When one camera's images came, and which of them are identical."""

    arrival_ns: np.ndarray
    """Host times of receipt [ns], shape (n,), int64."""
    sample_ns: np.ndarray
    """Estimated times of exposure [ns], shape (n,), int64."""
    digest: np.ndarray
    """CRC32 of each compressed picture, shape (n,), int64; 0 where it was not computed."""
    sequence: np.ndarray
    """Number of each image since the camera was opened, shape (n,), int64; gaps are lost images."""
    device_ns: np.ndarray
    """The camera's own time of each image [ns], shape (n,), int64; -1 without one."""


def image_stamps(records: Records, camera: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return arrival times [ns], numbers and device times [ns] (-1: none) of a camera's images, shape (n,), int64."""
    images = records.columns_of(topics.image(camera))
    device = device_times(records, camera)
    return images.log_ns, images.sequence, _array([device.get(k, -1) for k in images.sequence.tolist()])


def device_times(records: Records, camera: str) -> dict[int, int]:
    """Return the camera's own time [ns] of each image, by the image's number modulo 2^32."""
    times = map(pb.ImageTime.FromString, records.columns_of(topics.image_time(camera)).data)
    # MCAP keeps 32 bits of a sequence number.
    return {time.sequence & 0xFFFFFFFF: time.device_ns for time in times}


def image_times(records: Records, camera: str, clock: ClockModel | ImageClock | None) -> ImageTimes:
    """Return the times of a camera's images by its clock."""
    arrival, sequence, device = image_stamps(records, camera)
    digest = _array([int.from_bytes(value, "little") for value in records.columns_of(topics.image(camera)).data])
    return ImageTimes(arrival, _sample(clock, arrival, sequence, device), digest, sequence, device)


def clock_of(records: Records, camera: str, rate: float | None) -> ImageClock | ClockModel | None:
    """Return the clock of a camera's images: one with a time for each, or the recorder's where it stored too few.

    Args:
        records: The recording.
        camera: Its name in the rig file.
        rate: Its nominal rate [Hz]; None if unknown.
    """
    stored = records.metadata.get(f"clock_model/camera {camera}")
    model = ClockModel.from_document(stored) if stored else None
    return image_clock(*image_stamps(records, camera), model, rate) or model


def cube_stream(records: Records, camera: str, clock: ClockModel | None) -> TagStream:
    """Return the poses of a camera's cube."""
    return _stream(records, camera, clock, (topics.cube(camera), topics.pose(camera)), "")


def finger_streams(records: Records, camera: str, clock: ClockModel | ImageClock | None) -> tuple[TagStream, ...]:
    """Return the poses of each fingertip that a camera looked for."""
    names = topics.fingers((c.topic for c in records.channels.values()), camera)
    streams = (_stream(records, camera, clock, topics.finger(camera, name), name) for name in names)
    return tuple(stream for stream in streams if len(stream.faces))


def _stream(
    records: Records, camera: str, clock: ClockModel | ImageClock | None, pair: tuple[str, str], finger: str
) -> TagStream:
    views, messages = list(map(pb.CubeView.FromString, records.columns_of(pair[0]).data)), records.columns_of(pair[1])
    poses = {
        k: PoseInFrame.FromString(message).pose
        for k, message in zip(messages.sequence.tolist(), messages.data, strict=True)
    }
    position, quaternion = np.full((len(views), 3), np.nan), np.full((len(views), 4), np.nan)
    covariance = np.full((len(views), 6, 6), np.nan)
    for row, view in enumerate(views):
        # A message's sequence has 32 bits in MCAP.
        pose = poses.get(view.sequence & 0xFFFFFFFF)
        if pose is not None:
            p, q = pose.position, pose.orientation
            position[row], quaternion[row] = (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)
        if len(view.covariance) == 36:
            covariance[row] = np.array(view.covariance).reshape(6, 6)
    arrival, sequence = _array([v.arrival_ns for v in views]), _array([v.sequence for v in views])
    stamps = device_times(records, camera)
    device = _array([stamps.get(int(k) & 0xFFFFFFFF, -1) for k in sequence])
    return TagStream(
        camera,
        _sample(clock, arrival, sequence, device),
        position,
        quaternion,
        np.array([v.reprojection if v.faces else np.nan for v in views], dtype=float),
        _array([v.faces for v in views]),
        covariance,
        np.array([v.ambiguous for v in views], dtype=bool),
        tuple(tuple(v.ids) for v in views),
        finger,
        clock.uncertainties(sequence) if isinstance(clock, ImageClock) else None,
    )


def _sample(
    clock: ClockModel | ImageClock | None, arrival_ns: np.ndarray, sequence: np.ndarray, device_ns: np.ndarray
) -> np.ndarray:
    if clock is None:
        return arrival_ns
    if isinstance(clock, ImageClock):
        return clock.sample_times(arrival_ns, sequence)
    return clock.sample_times(arrival_ns, device_ns if clock.axis == "device_ns" else sequence)


def _array(values: list[Any]) -> np.ndarray:
    return np.array(values, dtype=np.int64)
