"""The camera images of a recording, as many as can be looked at."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.data_stream import ReadDataStream
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, MessageIndex
from mcap.stream_reader import get_chunk_data_stream

from tacdata.recording.files import topics
from tacdata.recording.files.mcap_records import read_records
from tacdata.viewers.scene.thinning import IMAGE_BYTES, IMAGES, evenly

RECORD = 1 + 8
"""Opcode and length before a record's body [bytes] (MCAP specification, "Records")."""
MESSAGE = 2 + 4 + 8 + 8
"""Channel, sequence and two times before a message's data [bytes] (MCAP specification, "Message")."""


class ImageSampler:
    """Keeps at most twice as many images of a camera as are drawn, at equal distance, while a file is read once."""

    def __init__(self, limit: int = IMAGES) -> None:
        self._most, self._step, self._count = limit, {}, {}
        self._kept: dict[str, list[bytes]] = {}

    def take(self, topic: str, message: memoryview) -> None:
        """Take the next image message of a topic."""
        number = self._count.get(topic, 0)
        self._count[topic] = number + 1
        messages, step = self._kept.setdefault(topic, []), self._step.setdefault(topic, 1)
        if number % step:
            return
        messages.append(bytes(message))
        # The number of images is known only at the end, so every other one is dropped whenever there are too many.
        if len(messages) > 2 * self._most or len(messages) * len(message) > 2 * IMAGE_BYTES:
            del messages[1::2]
            self._step[topic] = 2 * step

    def images(self, cameras: tuple[str, ...]) -> Iterator[tuple[str, int, bytes]]:
        """Yield camera name, time of exposure [ns] and JPEG image of those that are drawn."""
        for camera in cameras:
            messages = self._kept.get(topics.image(camera), [])
            room = IMAGE_BYTES * len(messages) // max(sum(map(len, messages)), 1)
            for k in evenly(len(messages), max(min(self._most, room), 2)):
                image = CompressedImage.FromString(messages[k])
                yield camera, image.timestamp.ToNanoseconds(), image.data


def recorded_images(path: Path, cameras: tuple[str, ...], most: int = IMAGES) -> Iterator[tuple[str, int, bytes]]:
    """Yield camera name, time of exposure [ns] and JPEG image of a recording's images.

    A finished file has an index of its images, and only requested ones are read; one that breaks off is
    read from its beginning to its end.

    Args:
        path: The recording.
        cameras: Names of the cameras.
        most: Images of a camera, taken at equal distance where there are more.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is no MCAP file.
    """
    if not cameras:
        return
    try:
        samples = _indexed(path, cameras, most)
    except Exception:  # a damaged index raises any error of the parser; the records show the content
        samples = None
    if samples is None:
        samples = _all(path, cameras, most)
    for camera, data in samples:
        image = CompressedImage.FromString(data)
        yield camera, image.timestamp.ToNanoseconds(), image.data


def _all(path: Path, cameras: tuple[str, ...], limit: int) -> list[tuple[str, bytes]]:
    records, samples = read_records(path), []
    for camera in cameras:
        messages = records.of_topic(topics.image(camera))
        samples += [(camera, messages[k].data) for k in evenly(len(messages), limit)]
    return samples


def _indexed(path: Path, cameras: tuple[str, ...], limit: int) -> list[tuple[str, bytes]] | None:
    """Return the wanted images by the file's index, or None if it has none."""
    with path.open("rb") as stream:
        summary = SeekingReader(stream).get_summary()
        if summary is None or not summary.chunk_indexes:
            return None
        ids = {channel.topic: number for number, channel in summary.channels.items()}
        samples: list[tuple[str, bytes]] = []
        for camera in cameras:
            number = ids.get(topics.image(camera))
            places = [] if number is None else _places(stream, summary.chunk_indexes, number)
            samples += [(camera, data) for data in _messages(stream, [places[k] for k in evenly(len(places), limit)])]
        return samples


def _places(stream: IO[bytes], chunks: list[ChunkIndex], channel: int) -> list[tuple[int, int]]:
    """Return start of the chunk and offset within it of a channel's messages, in the order of writing."""
    places = []
    for chunk in sorted(chunks, key=lambda c: c.chunk_start_offset):
        if channel in chunk.message_index_offsets:
            stream.seek(chunk.message_index_offsets[channel] + RECORD)
            index = MessageIndex.read(ReadDataStream(stream))
            places += [(chunk.chunk_start_offset, offset) for _, offset in sorted(index.records, key=lambda r: r[1])]
    return places


def _messages(stream: IO[bytes], places: list[tuple[int, int]]) -> Iterator[bytes]:
    opened, content = -1, b""
    for start, offset in places:
        # A chunk is decompressed once for all of its messages.
        if start != opened:
            stream.seek(start + RECORD)
            data, length = get_chunk_data_stream(Chunk.read(ReadDataStream(stream)), validate_crc=True)
            opened, content = start, data.read(length)
        (size,) = struct.unpack_from("<Q", content, offset + 1)
        yield content[offset + RECORD + MESSAGE : offset + RECORD + size]
