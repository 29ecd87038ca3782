"""The device's end of an emulated serial port."""

from __future__ import annotations

import errno
import os
import select
import termios
import threading
import time
import tty

import numpy as np

BACKLOG = 1 << 18
"""Bytes kept for a host that does not read [bytes]."""


class VirtualPort:
    """A pseudo-terminal: the host opens `path` with pyserial; the emulated device reads and writes here.

    As on a real line, data sent while nobody has the port open is lost, and a wrong baud rate gives garbage.
    """

    def __init__(self, baud: int, seed: int = 0) -> None:
        """Create a line on which the device sends at ``baud`` [bit/s]."""
        self.baud = baud
        self._speed = getattr(termios, f"B{baud}")
        self._noise = np.random.default_rng(seed)
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._unsent = bytearray()
        self._writing = threading.Lock()
        self._watch = select.poll()
        self._watch.register(self._master, select.POLLHUP)

    @property
    def connected(self) -> bool:
        """Whether a host has the port open."""
        return self._master >= 0 and not self._watch.poll(0)

    def read(self, timeout: float) -> bytes:
        """Return the bytes that the host has sent, waiting at most ``timeout`` [s, real time]; may be empty."""
        if not self.connected:
            time.sleep(min(max(timeout, 0.0), 0.02))
            return b""
        try:
            if not select.select([self._master], [], [], max(timeout, 0.0))[0]:
                return b""
            return self._heard(os.read(self._master, 4096))
        except (OSError, ValueError, termios.error):
            return b""

    def write(self, data: bytes) -> None:
        """Send to the host, after the bytes still waiting; beyond `BACKLOG` the newest bytes are lost."""
        with self._writing:
            if not self.connected:
                self._unsent.clear()
                return
            try:
                if len(self._unsent) + len(data) <= BACKLOG:
                    self._unsent += self._heard(data)
                while self._unsent:
                    del self._unsent[: os.write(self._master, self._unsent)]
            except termios.error:
                return  # unplugged at this moment
            except OSError as error:
                if error.errno not in (errno.EAGAIN, errno.EIO, errno.EBADF):
                    raise

    @property
    def waiting(self) -> bool:
        """Whether bytes wait for the host; any `write`, also an empty one, tries again."""
        return bool(self._unsent)

    def close(self) -> None:
        """Unplug: the host's next read fails."""
        master, self._master = self._master, -1
        if master >= 0:
            os.close(master)

    def _heard(self, data: bytes) -> bytes:
        if termios.tcgetattr(self._master)[5] == self._speed:
            return data
        return self._noise.integers(0, 256, len(data), dtype=np.uint8).tobytes()
