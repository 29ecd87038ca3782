"""Sends one line of JSON per estimate to every reader of a socket (`schemas/live_message.schema.json`); never waits.

A reader may write a line `tare`, which repeats the tare.
"""

import json
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from tacdata import schemas
from tacdata.errors import UsageError
from tacdata.live.depth_stream import Estimate

LOOPBACK = "127.0.0.1"
TARE = b"tare"
"""Command of a reader that repeats the tare."""
WAITING = 4
"""Messages that wait for a slow reader; beyond that the oldest are dropped [count]."""


def message(estimate: Estimate, source: dict[str, Any], sent_ns: int, maps: bool = True) -> dict[str, Any]:
    """Return an estimate as a message.

    Args:
        estimate: The estimate.
        source: Its source: ``finger``, ``network`` (hash), ``causal``, ``lookahead``.
        sent_ns: Now [ns].
        maps: Whether to include the whole map.
    """
    values: dict[str, Any] = {
        "version": schemas.version("live_message"),
        "sequence": estimate.sequence,
        **source,
        "sample_ns": estimate.sample_ns,
        "arrival_ns": estimate.arrival_ns,
        "sent_ns": sent_ns,
        "age_ms": round((sent_ns - estimate.sample_ns) * 1e-6, 3),
        "depth": round(estimate.largest, 4),
        "contact": estimate.centre is not None,
        "centre": None if estimate.centre is None else [round(value, 4) for value in estimate.centre],
    }
    if estimate.novelty is not None:
        values["novelty"] = round(estimate.novelty, 3)
    if estimate.below_tare:
        values["below_tare"] = round(estimate.below_tare, 1)
    if maps:
        values["map"] = [[round(float(value), 4) for value in row] for row in estimate.depth]
    return values


class MessageServer:
    """A server on the loopback interface; every reader gets the messages that it can take."""

    def __init__(self, port: int) -> None:
        """Open the socket; port 0 takes a free one.

        Raises:
            UsageError: If the port is taken or may not be opened.
        """
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind((LOOPBACK, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise UsageError(f"port {port}: {error}", "a free port, or 0 for any", "choose another --socket") from None
        self._socket.listen()
        self.port: int = self._socket.getsockname()[1]
        self._readers: list[_Reader] = []
        self._closed = False
        self.tare: Callable[[], None] = lambda: None
        """Called, in a thread of its own, when a reader asks for taring."""
        self._thread = threading.Thread(target=self._accept, name="live-messages", daemon=True)
        self._thread.start()

    @property
    def readers(self) -> int:
        """Number of connected readers."""
        return sum(reader.alive for reader in self._readers)

    def send(self, values: dict[str, Any]) -> None:
        """Pass a message to all readers; returns at once."""
        self._readers = [reader for reader in self._readers if reader.alive]
        if self._readers:
            line = json.dumps(values, separators=(",", ":")).encode() + b"\n"
            for reader in self._readers:
                reader.offer(line)

    def close(self) -> None:
        """Close the socket and all connections; may be called twice."""
        self._closed = True
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        for reader in self._readers:
            reader.close()
        self._thread.join(timeout=2.0)

    def _accept(self) -> None:
        while not self._closed:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            self._readers.append(_Reader(connection, lambda: self.tare()))


class _Reader:
    """One connection with a thread of its own: a controller that stalls must not delay the others."""

    def __init__(self, connection: socket.socket, tare: Callable[[], None]) -> None:
        self.alive, self._tare = True, tare
        self._connection, self._lines = connection, []
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # A large buffer would give old messages to a slow reader.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 32768)
        self._changed = threading.Condition()
        for part in (self._write, self._listen):
            threading.Thread(target=part, name="live-reader", daemon=True).start()

    def offer(self, line: bytes) -> None:
        with self._changed:
            self._lines = [*self._lines, line][-WAITING:]
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self.alive = False
            self._changed.notify()
        with suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()

    def _listen(self) -> None:
        # A reader that closes only its writing side still gets its messages.
        with suppress(OSError), self._connection.makefile("rb") as lines:
            for line in lines:
                if line.strip() == TARE:
                    self._tare()

    def _write(self) -> None:
        while self.alive:
            with self._changed:
                self._changed.wait_for(lambda: self._lines or not self.alive)
                lines, self._lines = self._lines, []
            try:
                for line in lines:
                    self._connection.sendall(line)
            except OSError:
                self.alive = False
