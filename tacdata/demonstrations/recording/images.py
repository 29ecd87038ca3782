"""The images that a recording stores, as they were stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.files import topics
from tacdata.recording.files.camera_arrays import image_times
from tacdata.recording.files.mcap_records import read_records


def stored_images(path: Path) -> tuple[np.ndarray, list[bytes]]:
    """Return the images of the first camera that stored any.

    Args:
        path: A recording, of a demonstration or a press.

    Returns:
        Times [ns], shape (n,), int64, rising; and n images, compressed as they came.

    Raises:
        FormatError: If the recording is damaged.
    """
    prefix, suffix = topics.image("\0").split("\0")
    streams: dict[str, list[bytes]] = {}

    def keep(topic: str, message: bytes | memoryview) -> None:
        if topic.startswith(prefix) and topic.endswith(suffix):
            name = topic.removeprefix(prefix).removesuffix(suffix)
            streams.setdefault(name, []).append(CompressedImage.FromString(bytes(message)).data)

    records = read_records(path, images=False, digests=False, seen=keep)
    for name, images in streams.items():
        if images:
            stored = records.metadata.get(f"clock_model/camera {name}")
            times = image_times(records, name, ClockModel.from_document(stored) if stored else None).sample_ns
            count = min(len(times), len(images))
            order = np.argsort(times[:count], kind="stable")
            return times[order], [images[k] for k in order]
    return np.array([], np.int64), []
