"""The computer of a virtual rig: its time waits for emulated devices that a busy processor delays."""

from __future__ import annotations

import mmap
import struct
import threading
import time
from pathlib import Path

from tacdata.errors import UsageError
from tacdata.host import Host

SLACK_NS = 50_000_000
"""Lateness of an emulated device that its clock does not wait for [ns, real time]."""
LONGEST_NS = 20_000_000_000
"""Longest single wait [ns, real time]. A rig that hangs for longer counts as silent, like a real one."""
NUMBER, PAIR = struct.Struct("q"), struct.Struct("qq")
NEVER = 2**62
EMPTY = NUMBER.pack(0) + PAIR.pack(0, NEVER) * 2
"""A number, and two places for the pair; the number's lowest bit names the valid one."""


class PacedHost(Host):
    """This computer, with a time that stops while an emulated device is late.

    A virtual rig writes two numbers into a small file: the sum of its waits, and the time that must not be passed
    yet. Its recorder reads them from there. So both processes see one time, and in that time no device is ever late.

    Raises:
        UsageError: By the first question, if the rig has ended.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> from tacdata.clock import Clock
        >>> from tacdata.paced_host import PacedHost
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     clock = Clock.start(8.0, PacedHost(Path(folder) / "pace", new=True))
        ...     clock.host.publish()
        ...     clock.serve("board", clock.now_ns())  # the time waits for the next call
    """

    longest_wait = LONGEST_NS * 1e-9

    def __init__(self, path: Path, new: bool = False) -> None:
        """Read the time of the rig that wrote ``path``, from the first question on; ``new``: of a rig to begin."""
        self.path = path
        self._memory: mmap.mmap | bytearray | None = bytearray(EMPTY) if new else None
        self._due: dict[str, int] = {}
        self._lock = threading.Lock()

    def publish(self) -> None:
        """Write the file of a new rig, before its devices start."""
        self.path.unlink(missing_ok=True)  # the readers of an earlier rig keep its file
        self.path.write_bytes(self._memory or b"")
        self._memory = None

    @property
    def waited(self) -> float:
        """Sum of the waits for devices [s, real time]."""
        return self._pair()[0] * 1e-9

    def monotonic(self) -> float:
        """Return a time that never steps, and stops while a device is late [s]."""
        return self.monotonic_ns() * 1e-9

    def monotonic_ns(self) -> int:
        """Return the same [ns]."""
        return _shown(time.monotonic_ns(), *self._pair())

    def serve(self, device: str, due_ns: int | None) -> None:
        """Let the time run until ``due_ns`` and the slack [ns, as shown], as far as this device is concerned."""
        with self._lock:
            if due_ns is None:
                self._due.pop(device, None)
            else:
                self._due[device] = due_ns
            real_ns = time.monotonic_ns()
            shown_ns = _shown(real_ns, *self._pair())
            limit_ns = min(self._due.values(), default=NEVER) + SLACK_NS
            # Nobody may see the time step back: a device that joins late finds the others ahead.
            self._publish(real_ns - shown_ns, max(limit_ns, shown_ns))

    def _publish(self, waited_ns: int, limit_ns: int) -> None:
        memory = self._open()
        number = NUMBER.unpack_from(memory)[0] + 1
        # Two places in turn: a reader never meets a pair of which half is old.
        PAIR.pack_into(memory, NUMBER.size + PAIR.size * (number % 2), waited_ns, limit_ns)
        NUMBER.pack_into(memory, 0, number)

    def _pair(self) -> tuple[int, int]:
        memory = self._memory or self._open()
        while True:
            number = NUMBER.unpack_from(memory)[0]
            pair = PAIR.unpack_from(memory, NUMBER.size + PAIR.size * (number % 2))
            if NUMBER.unpack_from(memory)[0] == number:
                return pair

    def _open(self) -> mmap.mmap | bytearray:
        if self._memory is None:
            try:
                with self.path.open("r+b") as file:
                    self._memory = mmap.mmap(file.fileno(), len(EMPTY))
            except FileNotFoundError:
                given = f"no clock at {self.path}: its virtual rig has ended"
                raise UsageError(given, "a rig that runs", "start tacdata virtual-rig again") from None
        return self._memory


def _shown(real_ns: int, waited_ns: int, limit_ns: int) -> int:
    """Return the time shown at a real time [ns]."""
    time_ns = real_ns - waited_ns
    return time_ns if time_ns <= limit_ns else limit_ns + max(time_ns - limit_ns - LONGEST_NS, 0)
