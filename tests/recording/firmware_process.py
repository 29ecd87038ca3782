"""Firmwares behind a pseudo-terminal: one built for a host, and the emulated one."""

import os
import pty
import select
import shlex
import subprocess
import threading
import time
import tty

import serial

from tacdata.clock import Clock
from tacdata.virtual_rig.firmware.controller import Controller


def tell(path, *lines):
    """Send lines one by one as a terminal would, until each is answered."""
    with serial.Serial(path, 115200, timeout=1.5) as port:
        end = time.monotonic() + 60
        heard = b""
        # One with an empty memory answers before its welcome, and then forgets what it was sent.
        while not heard or port.readline():
            assert time.monotonic() < end, "the firmware says nothing"
            if not heard:
                port.write(b"?")
                heard = port.readline()
        for line in lines:
            port.write(line.encode() + b"\n")
            while port.readline().strip() != b"ok":
                assert time.monotonic() < end, f"{line} is not answered"


class EmulatedFirmware:
    """The virtual rig's controller with an empty memory; as `Firmware`."""

    def __init__(self):
        defaults = {"$20": "0", "$22": "0"}
        self._clock = Clock.start()
        self._controller = Controller(self._clock, position=(0.0, 0.0, 0.0), settings=defaults, fresh=True)
        self.path = self._controller.port.path
        self._controller.start()

    def when(self, byte):
        """Return when a byte was last received [monotonic ns]."""
        begin = time.monotonic_ns() - self._clock.now_ns()
        return max((begin + t for b, t in self._controller.heard if b == byte), default=None)

    def close(self):
        self._controller.stop()


class Firmware:
    """Runs a command that speaks GRBL on its standard input and output; `path` is the port to open."""

    def __init__(self, command, folder):
        self._outer, slave = pty.openpty()
        tty.setraw(slave)
        self._slave, self.path = slave, os.ttyname(slave)
        self._inner, child = pty.openpty()
        tty.setraw(child)
        self.process = subprocess.Popen(
            shlex.split(command), stdin=child, stdout=child, stderr=subprocess.DEVNULL, cwd=folder
        )
        os.close(child)
        self.sent = []
        """What the host sent, as (monotonic time [ns], bytes)."""
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._pump, daemon=True)
        self._thread.start()

    def _pump(self):
        while not self._stopped.is_set():
            for source in select.select([self._outer, self._inner], [], [], 0.05)[0]:
                try:
                    data = os.read(source, 4096)
                    if source == self._outer:
                        self.sent.append((time.monotonic_ns(), data))
                    os.write(self._inner if source == self._outer else self._outer, data)
                except OSError:
                    return

    def when(self, byte):
        """Return when a byte was last sent [monotonic ns]."""
        return max((t for t, data in self.sent if byte in data), default=None)

    def close(self):
        self.process.kill()
        self.process.wait()
        self._stopped.set()
        self._thread.join()
        for end in (self._outer, self._inner, self._slave):
            os.close(end)
