"""A disk that is slow, full or takes less than it was given, when told to."""

import errno
import io
import os

from schedule import SECOND


class SimulatedDisk:
    """Files lie where they should on the real disk; what refuses or delays them is simulated."""

    def __init__(self, host):
        """Begin with a fast and empty disk."""
        self._host = host
        self.room = None
        """Bytes that still fit, or None for all."""
        self.slow = []
        """Stretches of time [ns] in which nothing is written or synced."""
        self.refused_ns = None
        """When it first refused something [ns]."""

    def create(self, path):
        """Open a new file, as ``path.open("xb")`` does."""
        return io.BufferedWriter(_File(self, path), 1 << 16)

    def sync(self, stream):
        """Write what the stream holds."""
        stream.flush()
        self.wait(self._host.schedule.random.uniform(0.001, 0.02))

    def wait(self, seconds):
        """Take time, until a slow stretch is over."""
        schedule = self._host.schedule
        end = schedule.now_ns + round(seconds * SECOND)
        end = max([end, *(b for a, b in self.slow if a <= schedule.now_ns < b)])
        if schedule.task is not None:
            while schedule.now_ns < end:
                schedule.block(end)

    def admit(self, wanted):
        """Return how many of ``wanted`` bytes fit; raise if none does."""
        if any(a <= self._host.schedule.now_ns < b for a, b in self.slow):
            self.wait(0.0)
        if self.room is None:
            draw = self._host.schedule.random
            return draw.randrange(1, wanted + 1) if wanted > 1 and draw.random() < 0.02 else wanted
        if not self.room:
            self.refused_ns = self.refused_ns or self._host.schedule.now_ns
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fits = min(wanted, self.room)
        self.room -= fits
        return fits

    @property
    def dead(self):
        """Whether the process has ended and writes nothing any more."""
        return self._host.killed


class _File(io.RawIOBase):
    def __init__(self, disk, path):
        self._disk, self._handle = disk, os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)

    def writable(self):
        return True

    def seekable(self):
        return True

    def tell(self):
        return os.lseek(self._handle, 0, os.SEEK_CUR)

    def seek(self, offset, whence=0):
        return os.lseek(self._handle, offset, whence)

    def fileno(self):
        return self._handle

    def write(self, data):
        if self._disk.dead:
            return len(data)
        fits = self._disk.admit(len(data))
        return os.write(self._handle, bytes(data[:fits]))

    def close(self):
        if not self.closed:
            super().close()
            os.close(self._handle)
