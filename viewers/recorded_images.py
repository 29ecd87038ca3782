"""The camera images of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from tacdata.recording import channels
from tacdata.recording.mcap_records import read_records


def recorded_images(path: Path, cameras: tuple[str, ...]) -> Iterator[tuple[str, int, bytes]]:
    """Yield camera name, time of exposure [ns] and JPEG image of every image in a recording.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is no MCAP file.
    """
    if not cameras:
        return
    records = read_records(path)
    for camera in cameras:
        for message in records.of_topic(channels.image(camera)):
            image = CompressedImage.FromString(message.data)
            yield camera, image.timestamp.ToNanoseconds(), image.data
