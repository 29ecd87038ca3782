"""Reads everything readable from an MCAP file, finished or cut off; reports the damaged parts."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any, cast
from zlib import crc32

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream

from tacdata.errors import FormatError, UsageError
from tacdata.recording.files.message_table import ChunkContent, MessageTable, Topic

PROFILE = "tacdata"
"""MCAP profile of our recordings."""
MAGIC = b"\x89MCAP0\r\n"
HEAD = 9
"""Opcode and length before each record's body [bytes] (MCAP specification, "Records")."""
SEARCH = 1 << 20
"""Bytes read at a time while searching the next chunk behind damage [bytes]."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log and publish time before a message's data (MCAP specification, "Message")."""
CHUNK = struct.Struct("<QQQII")
"""First and last time, size and checksum of a chunk's content, length of its compression's name (same place)."""
COMPRESSIONS = ("", "lz4", "zstd")
"""Compressions of chunks that MCAP names."""
UNKNOWN = "is left out: zstd, lz4 and none are known"
"""End of the words about a chunk of another compression."""
KNOWN = frozenset(opcode.value for opcode in Opcode)
PRIVATE = 0x80
"""Opcodes from here on are private to other programs."""


@dataclass
class Records:
    """The content of a file, in the order of writing."""

    path: Path
    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    table: MessageTable = field(default_factory=MessageTable)
    """All messages by column."""
    attachments: dict[str, Attachment] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    """Damaged parts, as sentences; empty for a file that was closed properly."""

    @property
    def messages(self) -> list[Message]:
        """All messages."""
        return self.table.objects()

    def of_topic(self, topic: str) -> list[Message]:
        """Return the messages of one topic, in the order of writing."""
        return self.table.objects(self._ids(topic))

    def columns_of(self, topic: str) -> Topic:
        """Return the messages of one topic by column, in a fraction of the time."""
        return self.table.topic(self._ids(topic))

    def _ids(self, topic: str) -> set[int]:
        return {channel.id for channel in self.channels.values() if channel.topic == topic}


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
    for block in _blocks(path, records.damage):
        take(records, block, images, digests, seen)
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
    records: Records, block: Any, images: bool, digests: bool, seen: Callable[[str, memoryview], None] | None
) -> None:
    """Add a record or an open chunk (`content`) to ``records``; other arguments as in `read_records`."""
    if not isinstance(block, ChunkContent):
        if isinstance(block, Message) and not images and block.channel_id in (cameras := _cameras(records, {})):
            block = replace(block, data=_stand_in(cameras[block.channel_id], memoryview(block.data), digests, seen))
        _take(records, block)
        return
    try:
        entries = [_parsed(*block.record(k)) for k in block.others()]
        named = {entry.id: entry.topic for entry in entries if isinstance(entry, Channel)}
        cameras = {} if images else _cameras(records, named)
        # Before anything of the chunk is taken: a chunk counts as a whole or not at all.
        heads, data = block.messages(cameras)
    except Exception as error:  # a record's own fields may be damaged in any way
        records.damage.append(f"a damaged chunk is left out ({type(error).__name__})")
        return
    for entry in entries:
        _take(records, entry)
    for k in np.flatnonzero(np.isin(heads["channel"], list(cameras))).tolist() if cameras else ():
        data[k] = _stand_in(cameras[int(heads["channel"][k])], data[k], digests, seen)
    records.table.extend(heads, data)


def _stand_in(topic: str, message: memoryview, digests: bool, seen: Callable[[str, memoryview], None] | None) -> bytes:
    if seen is not None:
        seen(topic, message)
    return _digest(bytes(message)) if digests else b""


def _cameras(records: Records, named: dict[int, str]) -> dict[int, str]:
    """Return the camera channels: those known before and those that a chunk names."""
    channels = {channel.id: channel.topic for channel in records.channels.values()} | named
    return {number: topic for number, topic in channels.items() if topic.endswith("/image")}


def _take(records: Records, record: Any) -> None:
    match record:
        case Header():
            records.profile = record.profile
        case Schema():
            records.schemas[record.id] = record
        case Channel():
            records.channels[record.id] = record
        case Message():
            records.table.add(record)
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
    for block in _blocks(path, damage):
        if not isinstance(block, ChunkContent):
            yield block
            continue
        try:
            parsed = [_parsed(*block.record(k)) for k in range(len(block.starts))]
        except Exception as error:  # a record's own fields may be damaged in any way
            damage.append(f"a damaged chunk is left out ({type(error).__name__})")
            continue
        yield from (record for record in parsed if record is not None)


def _blocks(path: Path, damage: list[str]) -> Iterator[Any]:
    """Yield as `walk` does, but chunks as a whole, their checksums verified."""
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
                yield from content(head[0], head, stream.read(length), damage)
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


def content(opcode: int, head: bytes, body: bytes, damage: list[str]) -> Iterator[Any]:
    """Yield the content of one record; a chunk as a whole (`ChunkContent`), its checksum verified.

    Raises:
        Exception: Any error of mcap's parser.
    """
    data = ReadDataStream(BytesIO(body))
    match opcode:
        case Opcode.HEADER:
            yield Header.read(data)
        case Opcode.SCHEMA:
            yield Schema.read(data)
        case Opcode.CHANNEL:
            yield Channel.read(data)
        case Opcode.MESSAGE:
            yield Message.read(data, len(body))
        case Opcode.METADATA:
            yield Metadata.read(data)
        case Opcode.ATTACHMENT:
            if not _intact_attachment(body):
                damage.append("a damaged attachment is left out")
            else:
                yield Attachment.read(data)
        case Opcode.CHUNK:
            try:
                chunk = _chunk(body)
                if chunk.compression not in COMPRESSIONS:
                    damage.append(f"a chunk of the compression {chunk.compression!r} {UNKNOWN}")
                    return
                stream, length = get_chunk_data_stream(chunk, validate_crc=True)
                opened = ChunkContent.split(stream.read(length))
            except Exception as error:  # the errors of zstd, struct and mcap share no base class
                damage.append(f"a damaged chunk is left out ({type(error).__name__})")
                return
            yield opened


def _chunk(body: bytes) -> Chunk:
    """Return a chunk as `Chunk.read` does, without copying its records.

    Raises:
        struct.error: If it is too short.
    """
    start, end, size, crc, length = CHUNK.unpack_from(body)
    place = CHUNK.size + length
    records = memoryview(body)[place + 8 : place + 8 + int.from_bytes(body[place : place + 8], "little")]
    compression = body[CHUNK.size : place].decode()
    return Chunk(compression, cast(bytes, records), end, start, crc, size)


def _parsed(opcode: int, body: bytes) -> Schema | Channel | Message | None:
    match opcode:
        case Opcode.SCHEMA:
            return Schema.read(ReadDataStream(BytesIO(body)))
        case Opcode.CHANNEL:
            return Channel.read(ReadDataStream(BytesIO(body)))
        case Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
            return Message(channel, log_time, body[MESSAGE.size :], publish_time, sequence)
    return None


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
