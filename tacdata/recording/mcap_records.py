"""Everything that can be read from an MCAP file, finished or cut off; what cannot is named, never guessed."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any
from zlib import crc32

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream

from tacdata.errors import FormatError, UsageError

PROFILE = "tacdata"
"""MCAP profile of a recording of ours."""
MAGIC = b"\x89MCAP0\r\n"
HEAD = 9
"""Opcode and length before each record's body [bytes] (MCAP specification, "Records")."""
SEARCH = 1 << 20
"""Bytes read at a time while looking for the next chunk behind damage [bytes]."""
RECORD, MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Head of a record; channel, sequence, log and publish time before a message's data (MCAP specification)."""
KNOWN = frozenset(opcode.value for opcode in Opcode)
PRIVATE = 0x80
"""Opcodes from here on are other programs' own."""


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
    """What could not be read, in words; empty for a file that was closed properly."""

    def of_topic(self, topic: str) -> list[Message]:
        """Return the messages of one topic, in the order of writing."""
        wanted = {channel.id for channel in self.channels.values() if channel.topic == topic}
        return [message for message in self.messages if message.channel_id in wanted]


def read_records(path: Path, images: bool = True) -> Records:
    """Read a file from its beginning to its end or to where it breaks off.

    Args:
        path: The file.
        images: Whether to keep the pictures; without them each message is replaced by its picture's CRC32,
            4 bytes, and a long recording needs little memory.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is no MCAP file at all.
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", "an MCAP recording", "check the path")
    records = Records(path)
    for record in walk(path, records.damage):
        match record:
            case Header():
                records.profile = record.profile
            case Schema():
                records.schemas[record.id] = record
            case Channel():
                records.channels[record.id] = record
            case Message():
                channel = records.channels.get(record.channel_id)
                picture = channel is not None and channel.topic.endswith("/image")
                if picture and not images:
                    record = replace(record, data=_digest(record.data))
                records.messages.append(record)
            case Attachment():
                records.attachments[record.name] = record
            case Metadata():
                records.metadata[record.name] = record.metadata
    if not records.profile and not records.channels and not records.attachments:
        raise FormatError(
            f"{path} is no MCAP file, or nothing of it can be read",
            "an MCAP file recorded by tacdata",
            "check the path; for a file of another kind, convert it first",
        )
    return records


def _digest(message: bytes) -> bytes:
    try:
        return crc32(CompressedImage.FromString(message).data).to_bytes(4, "little")
    except DecodeError:
        return crc32(message).to_bytes(4, "little")


def walk(path: Path, damage: list[str]) -> Iterator[Any]:
    """Yield every readable header, schema, channel, message, attachment and metadata record of a file.

    A record that does not fit is left out; reading goes on at the next whole chunk behind it.

    Args:
        path: The file.
        damage: Takes what could not be read, in words.
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
                yield from _content(head[0], head, stream.read(length), damage)
            except Exception as error:  # damaged lengths raise whatever the parser stumbles over
                damage.append(f"an unreadable record at byte {at} is left out ({type(error).__name__})")
            ended = head[0] == Opcode.FOOTER
        if ended and head[:1] == bytes([Opcode.FOOTER]) and stream.read() != MAGIC:
            damage.append("the closing magic is missing")


def _plausible(opcode: int, length: int) -> bool:
    return opcode >= PRIVATE or (opcode in KNOWN and (opcode != Opcode.FOOTER or length == 20))


def _content(opcode: int, head: bytes, body: bytes, damage: list[str]) -> Iterator[Any]:
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
                content = _chunk_content(Chunk.read(data))
            except Exception as error:  # zstd's, struct's and mcap's own errors share no base
                damage.append(f"a damaged chunk is left out ({type(error).__name__})")
                return
            yield from content


def _chunk_content(chunk: Chunk) -> list[Schema | Channel | Message]:
    """Return a chunk's records, its checksum checked; as `breakup_chunk` gives them, in less time."""
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    content, place = stream.read(size), 0
    records: list[Schema | Channel | Message] = []
    while place < len(content):
        opcode, length = RECORD.unpack_from(content, place)
        place += RECORD.size
        if place + length > len(content):
            raise ValueError("a record that is longer than its chunk")
        body = content[place : place + length]
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
            data = body[MESSAGE.size :]
            records.append(Message(channel, log_time=log_time, data=data, publish_time=publish_time, sequence=sequence))
        elif opcode == Opcode.SCHEMA:
            records.append(Schema.read(ReadDataStream(BytesIO(body))))
        elif opcode == Opcode.CHANNEL:
            records.append(Channel.read(ReadDataStream(BytesIO(body))))
        place += length
    return records


def _intact_attachment(body: bytes) -> bool:
    written = int.from_bytes(body[-4:], "little")
    return written in (0, crc32(body[:-4]))


def _skip_to_chunk(stream: IO[bytes], at: int, size: int, damage: list[str]) -> bool:
    """Move on to the next whole chunk behind a record that cannot be; return whether there is one."""
    for start in _candidates(stream, at + 1, size):
        stream.seek(start)
        head = stream.read(HEAD)
        length = int.from_bytes(head[1:], "little")
        try:
            breakup_chunk(Chunk.read(ReadDataStream(BytesIO(stream.read(length)))), validate_crc=True)
        except Exception:  # most candidates are no chunks
            continue
        damage.append(f"{start - at} unreadable bytes at byte {at} are left out")
        stream.seek(start)
        return True
    damage.append(f"the file breaks off after {size} bytes")
    return False


def _candidates(stream: IO[bytes], begin: int, size: int) -> Iterator[int]:
    """Yield places at which a chunk that fits into the file could begin."""
    for block in range(begin, size, SEARCH):
        stream.seek(block)
        data = stream.read(SEARCH + HEAD)
        place = data.find(Opcode.CHUNK)
        while 0 <= place < min(SEARCH, len(data) - HEAD):
            length = int.from_bytes(data[place + 1 : place + HEAD], "little")
            if 40 <= length <= size - block - place - HEAD:
                yield block + place
            place = data.find(Opcode.CHUNK, place + 1)
