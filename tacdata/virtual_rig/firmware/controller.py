"""An emulated Grbl 1.1 or grblHAL motion controller on a virtual port."""

from __future__ import annotations

import queue
import re
from collections import deque
from collections.abc import Callable

import numpy as np

from tacdata.clock import Clock
from tacdata.virtual_rig.firmware import texts
from tacdata.virtual_rig.firmware.dialect import NAMES
from tacdata.virtual_rig.firmware.interpreter import Interpreter
from tacdata.virtual_rig.firmware.machine import SOFT_LIMIT
from tacdata.virtual_rig.firmware.planner import Planner
from tacdata.virtual_rig.port import VirtualPort

REALTIME = b"?!~\x18"
"""Bytes that never reach the receive buffer; nor does any above 0x7F."""
TELL_ALL = 0x87
"""Query for a report with the alarm's number (grblHAL)."""
DROPPED = re.compile(r"[\x00-\x20/]")
"""Characters left out of a line: blanks, control characters, slashes."""
BYTE_SECONDS = 10 / 115200
NS = 1_000_000_000
Wire = Callable[[str], str | None]
"""Fault of a line on its way: returns the received line, or None if it is lost."""


class Controller:
    """The firmware's main loop in a thread, on the time of ``clock``.

    `position_at` is the true position of the machine. The reported one can differ after a loss of position.
    """

    def __init__(
        self,
        clock: Clock,
        seed: int = 0,
        position: tuple[float, float, float] = (-1.0, -1.0, -1.0),
        homed: bool = True,
        settings: dict[str, str] | None = None,
        offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
        firmware: str = "Grbl",
        fresh: bool = False,
        port: VirtualPort | None = None,
        echo: bool = False,
    ) -> None:
        """Switch on a machine at ``position`` [mm, machine]; ``offset`` is its G54 [mm].

        ``firmware`` is Grbl or grblHAL; a ``fresh`` one has empty memory. ``port`` is the line to the host, by
        default a pseudo-terminal. With ``echo`` received lines are sent back, as FluidNC's ``$GCode/Echo=on`` does.
        """
        self.clock = clock
        self.port = port or VirtualPort(115200, seed)
        self.firmware = kind = NAMES[firmware]
        self.settings = {**texts.DEFAULTS, **kind.changed, **(settings or {})}
        self._rng = np.random.default_rng(seed)
        self.machine = Interpreter(
            kind, self.settings, np.array(position, float), np.array(offset, float), homed, self._rng, self._say
        )
        self.heard: list[tuple[int, int]] = []
        """Real-time bytes other than ``?`` and when they came [ns]."""
        self._fresh, self._muted, self._echo = fresh, False, echo
        self._to_controller: Wire = lambda line: line
        self._to_host: Wire = lambda line: line
        self._lines: deque[tuple[int, str]] = deque()
        self._received = bytearray()
        self._out: deque[tuple[int, str]] = deque()
        self._report_ns: int | None = None
        self._faults: queue.SimpleQueue[Callable[[int], None]] = queue.SimpleQueue()
        self._stopped = clock.host.event()
        self._thread = clock.host.thread(self._run, "virtual-grbl")

    @property
    def planner(self) -> Planner:
        """The motion planner."""
        return self.machine.planner

    def start(self) -> None:
        """Switch on."""
        self.machine.power_on(self.clock.now_ns(), self._fresh)
        self._thread.start()

    def stop(self) -> None:
        """Switch off and unplug."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self.port.close()

    def position_at(self, time_ns: int) -> np.ndarray:
        """Return the true position of the carriage [mm], shape (3,), at a time of the recent past [ns]."""
        return self.planner.position(time_ns)

    def inject_alarm(self, code: int = 1) -> None:
        """Fault: a soft limit ends the motion after braking (2), a limit switch (1) or another alarm at once."""
        if code == SOFT_LIMIT:
            self._faults.put(self.machine.overtravel)
        else:
            self._faults.put(lambda now_ns: self._wiped(lambda: self.machine.stop_dead(now_ns, code)))

    def inject_brown_out(self) -> None:
        """Fault: the supply voltage drops; the firmware restarts and assumes position zero."""
        self._faults.put(lambda now_ns: self._wiped(lambda: self.machine.brown_out(now_ns)))

    def inject_reset(self) -> None:
        """Fault: another program sends 0x18."""
        self._faults.put(lambda now_ns: self._wiped(lambda: self.machine.reset(now_ns)))

    def inject_stop(self) -> None:
        """Fault: another program sends grblHAL's 0x19, or a digit 9 loses a bit."""
        self._faults.put(lambda now_ns: self._take(NAMES["grblHAL"].stop_byte, now_ns))

    def inject_stall(self, seconds: float) -> None:
        """Fault: the firmware does something else for so long [s], neither steps nor answers, and then goes on."""

        def stand(now_ns: int) -> None:
            self.machine.busy_until = now_ns + round(seconds * NS)
            self.planner.stall(now_ns, self.machine.busy_until)

        self._faults.put(stand)

    def inject_silence(self) -> None:
        """Fault: nothing is answered any more."""
        self._faults.put(lambda now_ns: setattr(self, "_muted", True))

    def inject_bytes(self, data: bytes) -> None:
        """Fault: bytes appear on the line."""
        self._faults.put(lambda now_ns: self.port.write(data))

    def inject_wire(self, to_controller: Wire | None = None, to_host: Wire | None = None) -> None:
        """Fault: lines, or answers and reports, are changed or lost on their way from now on."""

        def lay(now_ns: int) -> None:
            self._to_controller = to_controller or self._to_controller
            self._to_host = to_host or self._to_host

        self._faults.put(lay)

    def inject_pendant(self) -> None:
        """Fault: a pendant takes control; lines of the host are ignored and reports show it (grblHAL's ``MPG``)."""
        self.inject_wire(lambda line: None, lambda text: text.replace(">", "|MPG:1>") if text[:1] == "<" else text)

    def inject_door(self, is_open: bool) -> None:
        """Fault: the safety door opens or closes."""

        def turn(now_ns: int) -> None:
            self.machine.door_open = is_open
            if is_open:
                self.machine.open_door(now_ns)

        self._faults.put(turn)

    def inject_byte(self, byte: int) -> None:
        """Fault: another program sends a real-time byte, or a button does."""
        self._faults.put(lambda now_ns: self.machine.realtime(byte, now_ns))

    def inject_unreadable_memory(self) -> None:
        """Fault: stored parameters cannot be read; ``$#`` answers error:7 and then ok."""
        self._faults.put(lambda now_ns: setattr(self.machine, "unreadable", True))

    def unplug(self) -> None:
        """Fault: the cable is pulled."""
        self._faults.put(lambda now_ns: self.port.close())

    def _run(self) -> None:
        while not self._stopped.is_set():
            pause = self._pause()
            self.clock.serve(self.port.path, self.clock.now_ns() + round(pause * self.clock.rate * NS))
            data = self.port.read(pause)
            now_ns = self.clock.now_ns()
            while not self._faults.empty():
                self._faults.get()(now_ns)
            for byte in data:
                self._take(byte, now_ns)
            self.machine.serve(now_ns)
            self._serve_lines(now_ns)
            self._serve_output(self.clock.now_ns())
        self.clock.serve(self.port.path, None)

    def _pause(self) -> float:
        """Return how long nothing will happen unless a byte arrives [s, real time]."""
        due = [t for t in (self._report_ns, self.machine.next_event()) if t is not None]
        if self._out:
            due.append(self._out[0][0])
        if self._lines and self._lines[0][0] > self.clock.now_ns():
            due.append(self._lines[0][0])
        if not due:
            return 0.02
        # At most 20 ms, since a fault comes without a byte; at least 0.2 ms, so that the loop leaves the host some
        # time.
        return min(max((min(due) - self.clock.now_ns()) / NS / self.clock.rate, 0.0002), 0.02)

    def _take(self, byte: int, now_ns: int) -> None:
        if byte == ord("?") or (byte == TELL_ALL and self.machine.firmware is NAMES["grblHAL"]):
            self.machine.whole |= byte == TELL_ALL
            # As in the firmware, where a query sets a flag: one report answers all that came before it.
            if self._report_ns is None:
                step = self.machine.firmware.dwell_step if self.machine.dwell_ns is not None else 0.0
                self._report_ns = now_ns + int(self._rng.uniform(0.001, max(step, 0.014)) * NS)
        elif byte in REALTIME or byte > 0x7F or byte == self.machine.firmware.stop_byte:
            self.heard.append((byte, now_ns))
            if byte == 0x18:
                self._wiped(lambda: self.machine.reset(now_ns))
            elif byte == self.machine.firmware.stop_byte:
                self._wiped(lambda: self.machine.realtime(byte, now_ns))
            else:
                self.machine.realtime(byte, now_ns)
        elif self._waiting() >= self.machine.firmware.rx_bytes:
            return  # bytes beyond the buffer are lost, as in the firmware's ring buffer
        elif byte in (0x0A, 0x0D):
            due = now_ns + int((len(self._received) + 1) * BYTE_SECONDS * NS)
            line = self._to_controller(self._received.decode("ascii", "replace"))
            if line is not None:
                self._lines.append((due, line))
            self._received.clear()
        else:
            self._received.append(byte)

    def _waiting(self) -> int:
        return len(self._received) + sum(len(line) + 1 for _, line in self._lines)

    def _wiped(self, restart: Callable[[], None]) -> None:
        """Discard the lines that were received and not answered, then restart."""
        self._lines.clear()
        self._received.clear()
        self._out.clear()
        self._report_ns = None
        restart()

    def _serve_lines(self, now_ns: int) -> None:
        while self._lines and self._lines[0][0] <= now_ns and self.machine.takes_lines(now_ns):
            line = DROPPED.sub("", self._lines[0][1])
            self.machine.reading = not self.machine.admits(line, now_ns)
            if self.machine.reading:
                return
            self._lines.popleft()
            if self._echo:
                self._say(now_ns, f"[echo: {line}]")
            self.machine.execute(line, now_ns)

    def _serve_output(self, now_ns: int) -> None:
        if self._report_ns is not None and now_ns >= self._report_ns:
            due, self._report_ns = self._report_ns, None
            if not self.machine.silent(now_ns):
                text = self.machine.report(due, self.machine.firmware.rx_bytes - self._waiting())
                self._say(now_ns, text, lag=0.0)
        if self.port.waiting:
            # An empty write sends what the host had no room for.
            self.port.write(b"")
        while self._out and self._out[0][0] <= now_ns:
            text = self._to_host(self._out.popleft()[1])
            if not self._muted and text is not None:
                self.port.write(text.encode("ascii") + b"\r\n")

    def _say(self, now_ns: int, text: str, lag: float | None = None) -> None:
        # The USB bridge passes its bytes on once a millisecond.
        lag = self._rng.uniform(0.0005, 0.0015) if lag is None else lag
        due = now_ns + int((lag + len(text) * BYTE_SECONDS) * NS)
        # Lines keep their order on the wire, whatever their lags.
        self._out.append((max(due, self._out[-1][0]) if self._out else due, text))
