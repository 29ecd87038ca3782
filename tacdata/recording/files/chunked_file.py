"""An MCAP file that holds back less than a second of data: chunks are closed by age, not only by size."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from tacdata.errors import UsageError
from tacdata.host import COMPUTER, Host
from tacdata.provenance import code_version
from tacdata.recording.files.mcap_records import PROFILE
from tacdata.replacement import settle

CHUNK_BYTES = 1024 * 1024
"""A chunk is closed at this size at the latest [bytes]; few chunks keep the index in memory small."""
CHUNK_SECONDS = 0.5
"""... and at this age [s of real time]: the most that a kill can cost."""


class ChunkedFile:
    """A new MCAP file of protobuf channels. Not thread-safe."""

    def __init__(self, path: Path, chunk_seconds: float = CHUNK_SECONDS, host: Host = COMPUTER) -> None:
        """Create the file.

        Raises:
            UsageError: If it exists; a recording is never overwritten.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            # Exclusive creation, by the system: two recorders cannot take one file.
            self._stream = host.create(path)
        except FileExistsError:
            raise UsageError(
                f"{path} exists", "a new file; a recording is never overwritten", "choose another name"
            ) from None
        self.path, self._host = path, host
        self._chunk_seconds = chunk_seconds
        self._flushed_at = self._host.monotonic()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=f"tacdata {code_version()}")
        settle(path.parent)

    def register(self, topic: str, message: Any) -> None:
        """Open a channel for a protobuf message class."""
        name = message.DESCRIPTOR.full_name
        if name not in self._schemas:
            described = build_file_descriptor_set(message).SerializeToString()
            self._schemas[name] = self._writer.register_schema(name=name, encoding="protobuf", data=described)
        self._channels[topic] = self._writer.register_channel(topic, "protobuf", self._schemas[name])

    def add(self, topic: str, log_ns: int, publish_ns: int, sequence: int, data: bytes) -> None:
        """Append one message; ``sequence`` is truncated to the 32 bits of MCAP."""
        self._writer.add_message(self._channels[topic], log_ns, data, publish_ns, sequence & 0xFFFFFFFF)
        self.tick()

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Append an attachment."""
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    def describe(self, name: str, values: dict[str, str]) -> None:
        """Append a metadata record."""
        self._writer.add_metadata(name, values)

    def tick(self) -> None:
        """Close the chunk and sync it to the disk if it is old enough; call at least that often."""
        if self._host.monotonic() - self._flushed_at >= self._chunk_seconds:
            self.flush()

    def flush(self) -> None:
        """Close the chunk and sync it to the disk now.

        Raises:
            OSError: If the disk refuses it.
        """
        self._writer.flush()
        self._host.sync(self._stream)
        self._flushed_at = self._host.monotonic()

    def close(self) -> None:
        """Write the summary and close; if the disk refuses, the data so far stay readable."""
        try:
            self._writer.finish()
            self._host.sync(self._stream)
        finally:
            self.let_go()

    def let_go(self) -> None:
        """Close the file without a summary; never raises."""
        with suppress(OSError):
            self._stream.close()
