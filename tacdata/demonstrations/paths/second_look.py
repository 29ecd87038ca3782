"""Searches every stored image for tags; a recorder on a busy host only searches some of them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import FormatError, UsageError
from tacdata.recording.clocks.image_clock import ImageClock
from tacdata.recording.episode import TagStream
from tacdata.recording.files import topics
from tacdata.recording.files.camera_arrays import clock_of, image_times
from tacdata.recording.files.mcap_records import read_records
from tacdata.tags.detection.unread import Unread, why_unread
from tacdata.tags.tips import TipPose
from tacdata.tags.tracker import FingerTracker

SAMPLE = 8
"""Images, spread over a recording, that a second look takes."""


def look_again(recording: DemoRecording, progress: Callable[[int], None] = lambda done: None) -> DemoRecording:
    """Return a demonstration with the fingertips of all its images, in place of those found while recording.

    Args:
        recording: The demonstration.
        progress: Called with the number of images searched.

    Raises:
        UsageError: If the file is gone.
        FormatError: If an image has another size than in the camera's intrinsics.
    """
    trackers = {
        name: FingerTracker(entry["intrinsics"], recording.rig.fingers)
        for name, entry in recording.rig.cameras.items()
        if "intrinsics" in entry
    }
    image_topics = {topics.image(name): name for name in trackers}
    sightings: dict[str, list[dict[str, TipPose]]] = {name: [] for name in trackers}
    remarks: list[str] = []

    def search(topic: str, message: bytes | memoryview) -> None:
        if topic not in image_topics:
            return
        name, image = image_topics[topic], _image(bytes(message))
        view = None if image is None else trackers[name].update(image)
        sightings[name].append(view.tips if view else {})
        remarks.extend(f"camera {name}: {words}" for words in (view.remarks if view else ()))
        progress(sum(map(len, sightings.values())))

    records = read_records(recording.path, images=False, digests=False, seen=search)
    views: list[TagStream] = []
    for name, detections in sightings.items():
        clock = clock_of(records, name, recording.rig.cameras[name].get("rate"))
        stamps = image_times(records, name, clock)
        timing = None
        if isinstance(clock, ImageClock):
            timing = clock.uncertainties(stamps.sequence)
        views += [_stream(name, finger, stamps.sample_ns, detections, timing) for finger in recording.rig.fingers]
    # Remarks of the search while recording are replaced by those of this one; failures of devices stay.
    notes = tuple(note for note in recording.notes if not note.startswith("camera ") or "failed" in note)
    searched = f"all {sum(map(len, sightings.values()))} images"
    return replace(recording, views=tuple(views), notes=(*notes, *dict.fromkeys(remarks)), searched=searched)


def why_nothing_is_seen(recording: DemoRecording) -> Unread | None:
    """Return why the stored images of a demonstration show no tag that can be read; None if that is not known."""
    samples: dict[str, list[tuple[int, np.ndarray]]] = {}
    with suppress(UsageError, FormatError):  # the file may be gone by now: then nothing more is known
        samples = sampled(recording, SAMPLE)
    return why_unread([image for images in samples.values() for _, image in images])


def sampled(recording: DemoRecording, count: int) -> dict[str, list[tuple[int, np.ndarray]]]:
    """Return up to ``count`` images of each camera, spread evenly, each with its time of exposure [ns].

    Images are grey, uint8, shape (height, width).

    Raises:
        UsageError: If the file is gone.
        FormatError: If it cannot be read at all.
    """
    named = {topics.image(name): name for name in recording.rig.cameras}
    buffers: dict[str, dict[int, bytes]] = {name: {} for name in named.values()}
    passed = dict.fromkeys(buffers, 0)
    stride = dict.fromkeys(buffers, 1)

    def keep(topic: str, message: bytes | memoryview) -> None:
        if topic not in named:
            return
        name = named[topic]
        if passed[name] % stride[name] == 0:
            buffers[name][passed[name]] = bytes(message)
        passed[name] += 1
        # The number of images is known only at the end, so every other one is dropped whenever there are twice too
        # many.
        if len(buffers[name]) > 2 * count:
            stride[name] *= 2
            buffers[name] = {k: payload for k, payload in buffers[name].items() if k % stride[name] == 0}

    records = read_records(recording.path, images=False, digests=False, seen=keep)
    images: dict[str, list[tuple[int, np.ndarray]]] = {}
    for name, messages in buffers.items():
        times = image_times(records, name, clock_of(records, name, recording.rig.cameras[name].get("rate"))).sample_ns
        indices = [k for k in list(messages)[:: -(-len(messages) // count) or 1] if k < len(times)]
        opened = ((int(times[k]), _image(messages[k])) for k in indices)
        images[name] = [(time, image) for time, image in opened if image is not None]
    return images


def _image(message: bytes) -> np.ndarray | None:
    """Return a stored image, grey, uint8, shape (height, width); None if it is damaged."""
    import cv2

    data = np.frombuffer(CompressedImage.FromString(message).data, np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION) if len(data) else None


def _stream(
    camera: str, finger: str, times_ns: np.ndarray, detections: list[dict[str, TipPose]], timing: np.ndarray | None
) -> TagStream:
    count = min(len(times_ns), len(detections))
    position, quaternion = np.full((count, 3), np.nan), np.full((count, 4), np.nan)
    covariance, reprojection = np.full((count, 6, 6), np.nan), np.full(count, np.nan)
    faces, ambiguous = np.zeros(count, np.int64), np.zeros(count, bool)
    ids: list[tuple[int, ...]] = [()] * count
    for row in range(count):
        tip = detections[row].get(finger)
        if tip is None:
            continue
        position[row], quaternion[row] = tip.position, tip.quaternion
        covariance[row] = tip.covariance if np.isfinite(tip.covariance).all() else np.nan
        reprojection[row], faces[row] = tip.cube.reprojection, tip.cube.faces
        ambiguous[row], ids[row] = tip.cube.ambiguous, tip.cube.ids
    return TagStream(
        camera,
        times_ns[:count],
        position,
        quaternion,
        reprojection,
        faces,
        covariance,
        ambiguous,
        tuple(ids),
        finger,
        None if timing is None else timing[:count],
    )
