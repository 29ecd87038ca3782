"""Messages of an MCAP file by column: few objects, so that long recordings are read fast."""

from __future__ import annotations

import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Message

RECORD = struct.Struct("<BQ")
"""Head of a record: opcode and length of its body (MCAP specification, "Records")."""
HEAD = np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8")])
"""Head of a message before its data (MCAP specification, "Message")."""


@dataclass(frozen=True)
class Topic:
    """The messages of one topic, in the order of writing."""

    sequence: np.ndarray
    """Sequence numbers [1], shape (n,), int64."""
    log_ns: np.ndarray
    """Times of receipt [ns], shape (n,), int64."""
    data: list[bytes]
    """Content of each message, n entries."""


@dataclass(frozen=True)
class ChunkContent:
    """An open chunk, verified to contain whole records."""

    content: bytes
    starts: list[int]
    """Start of each record [bytes]."""

    @classmethod
    def split(cls, content: bytes) -> ChunkContent:
        """Find the records.

        Raises:
            ValueError: If one is longer than the remaining bytes.
        """
        starts, place, size, unpack = [], 0, len(content), RECORD.unpack_from
        while place < size:
            starts.append(place)
            place += RECORD.size + unpack(content, place)[1]
            if place > size:
                raise ValueError("a record that is longer than its chunk")
        return cls(content, starts)

    def record(self, number: int) -> tuple[int, bytes]:
        """Return the opcode and body of one record."""
        start = self.starts[number]
        opcode, length = RECORD.unpack_from(self.content, start)
        return opcode, self.content[start + RECORD.size : start + RECORD.size + length]

    def others(self) -> list[int]:
        """Return the numbers of the records that are no messages."""
        content = self.content
        return [k for k, start in enumerate(self.starts) if content[start] != Opcode.MESSAGE]

    def messages(self, large: Collection[int] = ()) -> tuple[np.ndarray, list[Any]]:
        """Return heads (`HEAD`) and data of the messages.

        Args:
            large: Channels whose data are not copied but seen through (`memoryview`).

        Raises:
            ValueError: If a message is shorter than its head.
        """
        flat = np.frombuffer(self.content, np.uint8)
        starts = np.array(self.starts, dtype=np.int64)
        ends = np.append(starts[1:], len(flat))
        is_message = flat[starts] == Opcode.MESSAGE
        starts, ends = starts[is_message], ends[is_message]
        first = starts + RECORD.size + HEAD.itemsize
        if (first > ends).any():
            raise ValueError("a message without its head")
        # All heads in one gather: one object a message would take most of the reading time.
        octets = flat[starts[:, None] + np.arange(RECORD.size, RECORD.size + HEAD.itemsize)]
        heads, content, view = octets.reshape(-1).view(HEAD), self.content, memoryview(self.content)
        through = np.isin(heads["channel"], list(large)).tolist() if large else [False] * len(heads)
        places = zip(first.tolist(), ends.tolist(), through, strict=True)
        return heads, [(view if is_large else content)[a:b] for a, b, is_large in places]


@dataclass
class MessageTable:
    """All messages of a file, in the order of writing."""

    _heads: list[np.ndarray] = field(default_factory=list)
    """Heads (`HEAD`) of each part that was added [in the file's own units], shape (messages of the part,)."""
    data: list[bytes] = field(default_factory=list)
    """Content of each message."""

    def extend(self, heads: np.ndarray, data: list[bytes]) -> None:
        """Append messages by their heads (`HEAD`), shape (n,), and data."""
        self._heads.append(heads)
        self.data += data

    def add(self, message: Message) -> None:
        """Append one message."""
        head = (message.channel_id, message.sequence, message.log_time, message.publish_time)
        self.extend(np.array([head], HEAD), [message.data])

    @property
    def heads(self) -> np.ndarray:
        """Their heads (`HEAD`), shape (n,)."""
        # Parts are joined once, at the first request after the last part.
        if len(self._heads) != 1:
            self._heads = [np.concatenate([np.zeros(0, HEAD), *self._heads])]
        return self._heads[0]

    def topic(self, channels: set[int]) -> Topic:
        """Return the messages of some channels by column."""
        heads = self.heads
        rows = np.flatnonzero(np.isin(heads["channel"], sorted(channels)))
        selection, data = heads[rows], self.data
        return Topic(
            selection["sequence"].astype(np.int64), selection["log"].astype(np.int64), [data[k] for k in rows.tolist()]
        )

    def objects(self, channels: set[int] | None = None) -> list[Message]:
        """Return messages as objects of the mcap package, all or those of some channels."""
        heads, data = self.heads, self.data
        if channels is not None:
            rows = np.flatnonzero(np.isin(heads["channel"], sorted(channels)))
            heads, data = heads[rows], [data[k] for k in rows.tolist()]
        return [
            Message(channel, log_time=log, data=payload, publish_time=publish, sequence=sequence)
            for (channel, sequence, log, publish), payload in zip(heads.tolist(), data, strict=True)
        ]
