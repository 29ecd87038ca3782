"""A serial line of a simulated world: two ends, and what happens to bytes on their way."""

import serial
from simulated_host import Waiters

PASS = 300_000
"""Time that bytes take from end to end, beside what the sender's own timing says [ns]."""
LINES = {}
"""The lines of the worlds that exist, by the name of the host's port."""
serial.protocol_handler_packages.append("simulation")


def serial_class_for_url(url):
    """Return the port's name and what opens it."""
    return url, lambda _port, *args, **options: HostPort(LINES[url], **options)


class Way:
    """One direction of a line: bytes that have arrived, and who waits for them."""

    def __init__(self, host, receiver):
        self._schedule = host.schedule
        self.arrived, self.readers = bytearray(), Waiters(receiver)
        self.change = lambda data: data
        """What becomes of the bytes of one write."""
        self.held_until = 0
        """Bytes wait on their way until then [ns]."""
        self._laid = 0  # how often it was plugged in: what was on its way before never arrives

    def send(self, data):
        data = self.change(bytes(data))
        if data:
            due = max(self._schedule.now_ns + PASS, self.held_until)
            self._schedule.at(due, lambda laid=self._laid: self._arrive(data, laid))

    def renew(self):
        """Lay it anew: nothing is wrong with it, and nothing is on its way."""
        self.change, self.held_until, self._laid = (lambda data: data), 0, self._laid + 1
        self.take()

    def _arrive(self, data, laid):
        if laid == self._laid:
            self.arrived += data
            self.readers.wake()

    def take(self, most=1 << 20):
        data = bytes(self.arrived[:most])
        del self.arrived[:most]
        return data


class SimulatedLine:
    """A line between a host and a device; also the device's end, with the methods of `VirtualPort`."""

    def __init__(self, name, computer, bench, baud):
        """Lay it; ``computer`` is the host's side, ``bench`` the device's."""
        self.path, self.baud, self.schedule = name, baud, computer.schedule
        self.to_host, self.to_device = Way(computer, computer), Way(computer, bench)
        self.opened_by, self.plugged, self.waiting = None, True, False
        self.computer, self._bench = computer, bench
        LINES[name] = self

    @property
    def connected(self):
        return self.plugged and self.opened_by is not None and self.opened_by.is_open

    def attach(self, computer):
        """Let another process have the host's end; the system has closed that of the one before."""
        self.opened_by, self.computer = None, computer
        self.to_host.readers = Waiters(computer)

    def read(self, timeout):
        """Return what the host sent, waiting at most ``timeout`` [s]."""
        if not self.to_device.arrived:
            self.to_device.readers.wait(self._bench.after(timeout))
        return self.to_device.take(4096)

    def write(self, data):
        if data and self.connected:
            self.to_host.send(data)

    def plug_in(self):
        """Plug it in again; whatever was on its way is gone."""
        self.plugged = True
        for way in (self.to_host, self.to_device):
            way.renew()

    def close(self):
        """Unplug it."""
        self.plugged = False
        self.to_host.readers.wake()


class HostPort:
    """The host's end, with what pyserial's ports have."""

    def __init__(self, line, baudrate=0, timeout=None, **_options):
        self._line, self.timeout, self.port, self.is_open, self.dtr = line, timeout, "", False, True

    def open(self):
        if not self._line.plugged:
            raise serial.SerialException(2, f"could not open port {self.port}: [Errno 2] No such file")
        self.is_open, self._line.opened_by = True, self
        self._line.to_host.take()

    def close(self):
        self.is_open = False
        self._line.to_host.readers.wake()

    @property
    def in_waiting(self):
        return len(self._line.to_host.arrived)

    def read(self, size=1):
        self._check()
        way, host = self._line.to_host, self._line.computer
        end = host.after(self.timeout)
        while not way.arrived and self.is_open and self._line.plugged and host.schedule.now_ns < end:
            way.readers.wait(end)
        self._check()
        return way.take(size)

    def write(self, data):
        self._check()
        self._line.computer.perhaps()
        self._line.to_device.send(data)
        return len(data)

    def _check(self):
        if not (self.is_open and self._line.plugged) or self._line.computer.killed:
            raise serial.SerialException("device reports readiness to read but returned no data (device disconnected?)")
