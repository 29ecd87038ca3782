"""Follows a recording that is still being written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mcap.opcode import Opcode

from tacdata.errors import FormatError, UsageError
from tacdata.recording.files.mcap_records import HEAD, MAGIC, Records, content, take


class GrowingFile:
    """Follows one file, also when the recorder renames it at its end."""

    def __init__(self, path: Path, seen: Callable[[str, memoryview], None] | None = None) -> None:
        """Open the file.

        Args:
            path: The file.
            seen: Takes the topic and message of each picture as it is read (`mcap_records.read_records`).

        Raises:
            UsageError: If there is no such file.
            FormatError: If it is no MCAP file.
        """
        if not path.is_file():
            raise UsageError(f"no file {path}", "a recording that is being written", "check the path")
        self.records = Records(path)
        self.finished = False
        """Whether the file was closed: no more comes."""
        self._seen, self._stream = seen, path.open("rb")
        if self._stream.read(len(MAGIC)) != MAGIC:
            self._stream.close()
            raise FormatError(f"{path} is no MCAP file", "a recording made by tacdata record", "check the path")

    def update(self) -> bool:
        """Read the appended bytes, up to the last complete record; return whether there was anything."""
        is_longer = False
        while not self.finished:
            at = self._stream.tell()
            head = self._stream.read(HEAD)
            length = int.from_bytes(head[1:], "little")
            body = self._stream.read(length) if len(head) == HEAD and length <= self._left() else b""
            if len(head) < HEAD or len(body) < length:
                self._stream.seek(at)  # the rest has not reached the disk
                return is_longer
            try:
                for block in content(head[0], body, self.records.damage):
                    take(self.records, block, images=False, digests=False, seen=self._seen)
            except Exception as error:  # damaged lengths raise any of the parser's errors
                name = type(error).__name__
                self.records.damage.append(f"an unreadable record at byte {at} is left out ({name})")
            self.finished, is_longer = head[0] == Opcode.FOOTER, True
        return is_longer

    def _left(self) -> int:
        at = self._stream.tell()
        size = self._stream.seek(0, 2)
        self._stream.seek(at)
        return size - at

    def close(self) -> None:
        """Close the file."""
        self._stream.close()
