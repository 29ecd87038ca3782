"""Services of the computer for a process: time, threads, the disk and signals; a simulated world gives its own."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO


class Condition(threading.Condition):
    """A condition that an interrupt may leave without its lock.

    After a wait the lock is taken back, and a Ctrl-C may come before that is done. Then there is nothing to release:
    the plain condition would hide the interrupt behind an error of its own.
    """

    def __exit__(self, *raised: Any) -> None:  # ty: ignore[incompatible-method-override]
        """Release the lock, if it is held."""
        try:
            super().__exit__(*raised)
        except RuntimeError:
            # Without an error on its way, a lock that is not held is a fault of the program.
            if raised[0] is None:
                raise


class Host:
    """The computer that this process runs on.

    Whatever drives devices or records them asks its clock's host (`tacdata.clock.Clock.host`). It does not use `time`,
    `threading` or `signal` itself. So a test can run it in a world of its own, with drawn faults and faster than real
    time.

    Example:
        >>> from tacdata.host import COMPUTER
        >>> COMPUTER.sleep(0.001)
    """

    longest_wait = 0.0
    """Longest time for which its time may stop, to wait for an emulated device [s, real time]."""

    def monotonic(self) -> float:
        """Return a time that never steps [s, real time]."""
        return time.monotonic()

    def monotonic_ns(self) -> int:
        """Return the same [ns]."""
        return time.monotonic_ns()

    def time_ns(self) -> int:
        """Return Unix time [ns since 1970]."""
        return time.time_ns()

    def sleep(self, seconds: float) -> None:
        """Wait [s, real time]."""
        time.sleep(seconds)

    def serve(self, device: str, due_ns: int | None) -> None:
        """Take that an emulated device has nothing to do before ``due_ns`` [ns]. This computer waits for none."""

    def thread(self, target: Callable[..., None], name: str, args: tuple[Any, ...] = ()) -> threading.Thread:
        """Return a thread that is not started yet and does not keep the process alive."""
        return threading.Thread(target=target, args=args, name=name, daemon=True)

    def event(self) -> threading.Event:
        """Return a flag that threads can wait for."""
        return threading.Event()

    def condition(self) -> threading.Condition:
        """Return a condition with a reentrant lock of its own."""
        return Condition()

    def lock(self) -> Any:
        """Return a reentrant lock."""
        return threading.RLock()

    def queue(self) -> SimpleQueue[Any]:
        """Return a queue between threads."""
        return SimpleQueue()

    def create(self, path: Path) -> BinaryIO:
        """Open a new file for writing.

        Raises:
            FileExistsError: If it exists.
            OSError: If the disk refuses it.
        """
        return path.open("xb")

    def sync(self, stream: BinaryIO) -> None:
        """Write the stream's contents to the disk.

        Raises:
            OSError: If the disk refuses it.
        """
        stream.flush()
        os.fsync(stream.fileno())

    def signal(self, number: int, handler: Any) -> Any:
        """Set a signal's handler and return the previous one; main thread only."""
        return signal.signal(number, handler)


COMPUTER = Host()
"""This computer."""
