"""Rewrites a damaged recording with a summary, so that every MCAP reader opens it."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from tacdata.errors import DeviceError, Exit, FormatError, UsageError, refused_by_system
from tacdata.provenance import code_version
from tacdata.recording.files.mcap_records import UNKNOWN, counted, walk


@dataclass
class Recovered:
    """Result of a recovery."""

    path: Path
    """The new file."""
    messages: int = 0
    """Messages in it."""
    attachments: int = 0
    """Attachments in it."""
    damage: list[str] = field(default_factory=list)
    """Faults of the old file, as sentences; empty if nothing was."""


class NothingRecovered(FormatError):
    """Not one message of a file can be read."""

    exit_code = Exit.UNFIT


def recover(path: Path, target: Path | None = None) -> Recovered:
    """Write the readable part of ``path`` into its folder, as ``NAME.recovered.mcap``; the old file is kept.

    The copy is marked incomplete and names the damage. It keeps every message, time and attachment.

    Raises:
        UsageError: If there is no such file or the target exists.
        NothingRecovered: If it is no MCAP file, or not one message can be read.
        DeviceError: If the disk refuses the copy, or the copy does not read back.
    """
    path = Path(path)
    if path.is_dir():
        raise UsageError(
            f"{path} is a folder",
            "one MCAP recording",
            "name its file that was broken off (NAME.partial.mcap, NAME.interrupted-0.mcap); `tacdata record --resume` "
            "goes on with a session without it",
        )
    if not path.is_file():
        raise UsageError(f"no file {path}", "an MCAP recording", "check the path")
    target = target or path.with_name(path.name.removesuffix(".mcap") + ".recovered.mcap")
    result = Recovered(target)
    try:
        # By the system, not by a look before: the file may appear in between.
        stream = target.open("xb")
    except FileExistsError:
        raise UsageError(
            f"{target} exists", "a new file; nothing is overwritten", "remove it or name another with --out"
        ) from None
    except OSError as error:
        raise _refused(target, error) from error
    try:
        with stream:
            _Copy(Writer(stream, compression=CompressionType.ZSTD), result).run(path)
        if not result.messages:
            raise _nothing(path, result)
        # Before success is reported: a disk may have kept less than it was given.
        _read_back(result)
    except OSError as error:
        target.unlink(missing_ok=True)
        raise _refused(target, error) from error
    # No half copy stays, not even after Ctrl-C.
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return result


class _Copy:
    """Copies record by record, so that memory stays small."""

    def __init__(self, writer: Writer, result: Recovered) -> None:
        self.writer, self.found = writer, result
        self.begun = False
        self.schemas: dict[int, int] = {}
        self.channels: dict[int, int] = {}
        self.orphans = 0
        self.episode: dict[str, str] | None = None

    def run(self, path: Path) -> None:
        for record in walk(path, self.found.damage):
            # At the first readable record, so that a file whose header is lost is copied too.
            if not self.begun:
                profile = record.profile if isinstance(record, Header) else ""
                self.writer.start(profile=profile, library=f"tacdata {code_version()}")
                self.begun = True
            self._take(record)
        if not self.begun:
            return
        damage = self.found.damage
        if self.orphans:
            damage.append(f"{self.orphans} messages without their channel are left out")
        if damage or self.episode is None:
            cause = (self.episode or {}).get("reason", "")
            reason = "; ".join(filter(None, [cause, "recovered", *damage]))
            self.episode = {"complete": json.dumps(False), "reason": reason}
        self.writer.add_metadata("episode", self.episode)
        self.writer.finish()

    def _take(self, record: Any) -> None:
        match record:
            case Schema() if record.id not in self.schemas:
                number = self.writer.register_schema(record.name, record.encoding, record.data)
                self.schemas[record.id] = number
            case Channel() if record.id not in self.channels:
                # The writer assigns numbers of its own to schemas and channels.
                schema = self.schemas.get(record.schema_id, 0)
                self.channels[record.id] = self.writer.register_channel(
                    record.topic, record.message_encoding, schema, record.metadata
                )
            case Message() if record.channel_id in self.channels:
                number = self.channels[record.channel_id]
                self.writer.add_message(number, record.log_time, record.data, record.publish_time, record.sequence)
                self.found.messages += 1
            case Message():
                self.orphans += 1
            case Attachment():
                self.writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
                self.found.attachments += 1
            case Metadata() if record.name == "episode":
                self.episode = record.metadata
            case Metadata():
                self.writer.add_metadata(record.name, record.metadata)


def _read_back(result: Recovered) -> None:
    """Read the copy as any MCAP reader does.

    Raises:
        DeviceError: If it does not hold every message that was written.
    """
    try:
        with result.path.open("rb") as stream:
            count = sum(1 for _ in SeekingReader(stream, validate_crcs=True).iter_messages())
        wrong = "" if count == result.messages else f"{count} of {result.messages} messages"
    except (McapError, struct.error, ValueError) as error:
        wrong = str(error)
    if wrong:
        raise DeviceError(
            f"{result.path} was written and does not read back: {wrong}",
            "a disk that keeps what it was given",
            "use another disk with --out; the damaged recording is unchanged",
        )


def _nothing(path: Path, result: Recovered) -> NothingRecovered:
    if not result.attachments:
        return NothingRecovered(
            f"{path} is no MCAP file, or nothing of it can be read",
            "an MCAP file recorded by tacdata",
            "check the path; for a file of another kind, convert it first",
        )
    compressed = any(UNKNOWN in words for words in result.damage)
    return NothingRecovered(
        f"{path} breaks off before its first message: {'; '.join(counted(result.damage)) or 'it holds none'}",
        "a recording with at least one message",
        "write it again with zstd by the program that compressed it"
        if compressed
        else "nothing can be restored; record that press again with tacdata record --resume",
    )


def _refused(target: Path, error: OSError) -> DeviceError:
    known = refused_by_system(error)
    allowed, remedy = (known.allowed, known.remedy) if known else ("a disk with room for the copy", "use --out")
    return DeviceError(f"writing {target} failed: {error}", allowed, remedy)
