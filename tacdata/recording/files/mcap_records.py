"""Reads everything readable from an MCAP file, finished or cut off; reports the damaged parts."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any
from zlib import crc32

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream

from tacdata.errors import FormatError, UsageError

PROFILE = "tacdata"
"""MCAP profile of our recordings."""
MAGIC = b"\x89MCAP0\r\n"
HEAD = 9
"""Opcode and length before each record's body [bytes] (MCAP specification, "Records")."""
SEARCH = 1 << 20
"""Bytes read at a time while searching the next chunk behind damage [bytes]."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log and publish time before a message's data (MCAP specification, "Message")."""
RECORD = struct.Struct("<BQ")
"""Opcode and length of a record's body (same place, "Records")."""
COMPRESSIONS = ("", "lz4", "zstd")
"""Compressions of chunks that MCAP names."""
UNKNOWN = "is left out: zstd, lz4 and none are known"
"""End of the words about a chunk of another compression."""
KNOWN = frozenset(opcode.value for opcode in Opcode)
PRIVATE = 0x80
"""Opcodes from here on are private to other programs."""


@dataclass(frozen=True)
class Topic:
    """The messages of one topic, in the order of writing."""

    sequence: np.ndarray
    """Sequence numbers [1], shape (n,), int64."""
    log_ns: np.ndarray
    """Times of receipt [ns], shape (n,), int64."""
    data: list[bytes]
    """Content of each message, n entries."""


@dataclass
class Records:
    """The content of a file, in the order of writing."""

    path: Path
    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: list[Message] = field(default_factory=list)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    """Damaged parts, as sentences; empty for a file that was closed properly."""

    def of_topic(self, topic: str) -> list[Message]:
        """Return the messages of one topic, in the order of writing."""
        numbers = {channel.id for channel in self.channels.values() if channel.topic == topic}
        return [message for message in self.messages if message.channel_id in numbers]

    def columns_of(self, topic: str) -> Topic:
        """Return the messages of one topic by column."""
        messages = self.of_topic(topic)
        sequence = np.array([message.sequence for message in messages], np.int64)
        # MCAP's times are unsigned; one beyond int64 is damage, and wraps.
        log = np.array([message.log_time for message in messages], np.uint64).astype(np.int64)
        return Topic(sequence, log, [message.data for message in messages])


def read_records(
    path: Path, images: bool = True, digests: bool = True, seen: Callable[[str, memoryview], None] | None = None
) -> Records:
    """Read a file to its end, or to where it was cut off.

    Args:
        path: The file.
        images: Whether to keep the pictures; without them each message is replaced by its picture's CRC32,
            4 bytes, and a long recording needs little memory.
        digests: Whether to compute the CRC32. Without it a picture leaves no data, which is much faster.
        seen: Takes the topic and message of each picture that is not kept; it must copy the parts that it keeps.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is no MCAP file at all.
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", "an MCAP recording", "check the path")
    records = Records(path)
    for record in walk(path, records.damage):
        take(records, record, images, digests, seen)
    if not records.profile and not records.channels and not records.attachments:
        raise FormatError(
            f"{path} is no MCAP file, or nothing of it can be read",
            "an MCAP file recorded by tacdata",
            "check the path; measured files of another rig come in by `tacdata import`",
        )
    return records


def counted(damage: list[str]) -> list[str]:
    """Return descriptions of damage, each once, with how often it occurs."""
    return [f"{words} ({count} times)" if count > 1 else words for words, count in Counter(damage).items()]


def take(
    records: Records, record: Any, images: bool, digests: bool, seen: Callable[[str, memoryview], None] | None
) -> None:
    """Add a record to ``records``; other arguments as in `read_records`."""
    match record:
        case Header():
            records.profile = record.profile
        case Schema():
            records.schemas[record.id] = record
        case Channel():
            records.channels[record.id] = record
        case Message():
            channel = records.channels.get(record.channel_id)
            if not images and channel is not None and channel.topic.endswith("/image"):
                if seen is not None:
                    seen(channel.topic, memoryview(record.data))
                record.data = _digest(record.data) if digests else b""
            records.messages.append(record)
        case Attachment():
            records.attachments[record.name] = record
        case Metadata():
            records.metadata[record.name] = record.metadata


def _digest(message: bytes) -> bytes:
    try:
        return crc32(CompressedImage.FromString(message).data).to_bytes(4, "little")
    except DecodeError:
        return crc32(message).to_bytes(4, "little")


def walk(path: Path, damage: list[str]) -> Iterator[Any]:
    """Yield every readable header, schema, channel, message, attachment and metadata record of a file.

    A record that cannot be read is left out. Reading continues at the next complete chunk behind it.

    Args:
        path: The file.
        damage: Takes the description of each damaged part.

    Raises:
        FormatError: If another recording follows the end of the first.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            damage.append("the opening magic is missing")
            stream.seek(0)
        ended = False
        while not ended:
            at = stream.tell()
            head = stream.read(HEAD)
            length = int.from_bytes(head[1:], "little")
            if head[:8] == MAGIC and at + len(MAGIC) == size:
                damage.append("the footer is missing")
                return
            if len(head) < HEAD or at + HEAD + length > size or not _plausible(head[0], length):
                ended = not _skip_to_chunk(stream, at, size, damage)
                continue
            try:
                yield from content(head[0], stream.read(length), damage)
            except Exception as error:  # damaged lengths raise any of the parser's errors
                damage.append(f"an unreadable record at byte {at} is left out ({type(error).__name__})")
            ended = head[0] == Opcode.FOOTER
        if ended and head[:1] == bytes([Opcode.FOOTER]):
            end = stream.tell() + len(MAGIC)
            closing = stream.read(2 * len(MAGIC))
            # The closing magic of one file, followed by the opening magic of the next.
            if closing == 2 * MAGIC:
                raise FormatError(
                    f"{path} is several recordings joined: another one begins at byte {end} of {size}",
                    "one recording a file",
                    f"take them apart (head -c {end} for the first, tail -c +{end + 1} for the rest)",
                )
            if closing != MAGIC:
                damage.append("the closing magic is missing")


def _plausible(opcode: int, length: int) -> bool:
    # A footer always has 20 bytes: two offsets and a checksum (MCAP specification, "Footer").
    return opcode >= PRIVATE or (opcode in KNOWN and (opcode != Opcode.FOOTER or length == 20))


def content(opcode: int, body: bytes, damage: list[str]) -> Iterator[Any]:
    """Yield one record, or those of a chunk: all of them or none, its checksum verified.

    Raises:
        Exception: Any error of mcap's parser.
    """
    data = ReadDataStream(BytesIO(body))
    match opcode:
        case Opcode.HEADER:
            yield Header.read(data)
        case Opcode.METADATA:
            yield Metadata.read(data)
        case Opcode.ATTACHMENT:
            if not _intact_attachment(body):
                damage.append("a damaged attachment is left out")
            else:
                yield Attachment.read(data)
        case Opcode.CHUNK:
            try:
                chunk = Chunk.read(data)
                if chunk.compression not in COMPRESSIONS:
                    damage.append(f"a chunk of the compression {chunk.compression!r} {UNKNOWN}")
                    return
                stream, length = get_chunk_data_stream(chunk, validate_crc=True)
                records = _split(stream.read(length))
            except Exception as error:  # the errors of zstd, struct and mcap share no base class
                damage.append(f"a damaged chunk is left out ({type(error).__name__})")
                return
            yield from records
        case _:
            yield from _parsed(opcode, body)


def _split(content: bytes) -> list[Schema | Channel | Message]:
    """Return the records of an open chunk.

    Raises:
        ValueError: If one is longer than the remaining bytes.
    """
    records, place = [], 0
    while place < len(content):
        opcode, length = RECORD.unpack_from(content, place)
        begin, place = place + RECORD.size, place + RECORD.size + length
        if place > len(content):
            raise ValueError("a record that is longer than its chunk")
        records += _parsed(opcode, content[begin:place])
    return records


def _parsed(opcode: int, body: bytes) -> tuple[Schema | Channel | Message, ...]:
    """Return the schema, channel or message that a record is; none of another kind."""
    match opcode:
        case Opcode.SCHEMA:
            return (Schema.read(ReadDataStream(BytesIO(body))),)
        case Opcode.CHANNEL:
            return (Channel.read(ReadDataStream(BytesIO(body))),)
        case Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
            return (Message(channel, log_time, body[MESSAGE.size :], publish_time, sequence),)
    return ()


def _intact_attachment(body: bytes) -> bool:
    written = int.from_bytes(body[-4:], "little")
    # A checksum of 0 means that none was computed (MCAP specification, "Attachment").
    return written in (0, crc32(body[:-4]))


def _skip_to_chunk(stream: IO[bytes], at: int, size: int, damage: list[str]) -> bool:
    """Move on to the next complete chunk behind a damaged record; return whether there is one."""
    for start in _candidates(stream, at + 1, size):
        stream.seek(start)
        head = stream.read(HEAD)
        length = int.from_bytes(head[1:], "little")
        try:
            # Its checksum decides whether these bytes are a chunk.
            breakup_chunk(Chunk.read(ReadDataStream(BytesIO(stream.read(length)))), validate_crc=True)
        except Exception:  # most candidates are no chunks
            continue
        damage.append(f"{start - at} unreadable bytes at byte {at} are left out")
        stream.seek(start)
        return True
    damage.append(f"the file breaks off after {size} bytes")
    return False


def _candidates(stream: IO[bytes], begin: int, size: int) -> Iterator[int]:
    """Yield positions at which a chunk that fits into the file could begin."""
    for block in range(begin, size, SEARCH):
        stream.seek(block)
        # Blocks overlap by a head, which may otherwise be cut in two.
        data = stream.read(SEARCH + HEAD)
        place = data.find(Opcode.CHUNK)
        while 0 <= place < min(SEARCH, len(data) - HEAD):
            length = int.from_bytes(data[place + 1 : place + HEAD], "little")
            # 40 bytes are the fields of a chunk without content.
            if 40 <= length <= size - block - place - HEAD:
                yield block + place
            place = data.find(Opcode.CHUNK, place + 1)
