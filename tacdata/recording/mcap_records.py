"""Everything that can be read from an MCAP file, finished or cut off; what cannot is named, never guessed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from tacdata.errors import FormatError, UsageError

PROFILE = "tacdata"
"""MCAP profile of a recording of ours."""


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


def read_records(path: Path) -> Records:
    """Read a file from its beginning to its end or to where it breaks off.

    Raises:
        UsageError: If there is no such file.
        FormatError: If it is no MCAP file at all.
    """
    if not path.is_file():
        raise UsageError(f"no file {path}", "an MCAP recording", "check the path")
    records = Records(path)
    with path.open("rb") as stream:
        try:
            for record in StreamReader(
                stream, emit_chunks=True, record_size_limit=path.stat().st_size
            ).records:
                _take(records, record)
        except InvalidMagic as error:
            if not records.profile and not records.channels:
                raise _foreign(path) from error
            records.damage.append("the closing magic is missing")
        except Exception as error:  # damaged lengths raise whatever the parser stumbles over
            at = stream.tell()
            cut = at >= path.stat().st_size or isinstance(error, EndOfFile | RecordLengthLimitExceeded)
            what = type(error).__name__
            records.damage.append(
                f"the file breaks off after {at} bytes" if cut else f"unreadable at byte {at}: {what}"
            )
    if not records.profile and not records.channels and not records.attachments:
        raise _foreign(path)
    return records


def _take(records: Records, record: Any) -> None:
    match record:
        case Header():
            records.profile = record.profile
        case Chunk():
            _take_chunk(records, record)
        case Schema():
            records.schemas[record.id] = record
        case Channel():
            records.channels[record.id] = record
        case Message():
            records.messages.append(record)
        case Attachment():
            records.attachments[record.name] = record
        case Metadata():
            records.metadata[record.name] = record.metadata
        case DataEnd() | Footer() | _:
            pass


def _take_chunk(records: Records, chunk: Chunk) -> None:
    try:
        content = breakup_chunk(chunk, validate_crc=True)
    except Exception as error:  # zstd's, struct's and mcap's own errors share no base
        records.damage.append(f"a damaged chunk is left out ({type(error).__name__})")
        return
    for record in content:
        _take(records, record)


def _foreign(path: Path) -> FormatError:
    return FormatError(
        f"{path} is no MCAP file, or nothing of it can be read",
        "an MCAP file recorded by tacdata",
        "check the path; for a file of another kind, convert it first",
    )
