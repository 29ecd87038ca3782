"""The conversation with a GRBL controller: lines answered one by one, real-time bytes, polled status."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import serial

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus
from tacdata.errors import DeviceError
from tacdata.wire import grbl_codes
from tacdata.wire.grbl_lines import ALARM, MM_PER_INCH, RESPONSE, WELCOME, StatusReport, parse_status
from tacdata.wire.serial_port import read_available

REAL_FLOOR = 1.0
"""No wait for the controller gives up sooner than this [s, real time], however fast the clock runs."""
SILENCE = 3.0
"""A controller that is asked and says nothing for so long is gone [s of the clock]."""


def deadline(clock: Clock, seconds: float) -> float:
    """Return the `time.monotonic` value at which a wait of ``seconds`` [s of the clock] ends."""
    return time.monotonic() + max(seconds / clock.rate, REAL_FLOOR)


class GrblLink:
    """One open line to a controller, with a reading and a polling thread.

    Send-response: a line goes out only when the one before is answered, and only a line that is exactly
    ``ok`` or ``error:N`` is an answer. What stops the machine for good (alarm, unexpected welcome, broken
    line, silence) is kept as `fault` and raised by every later call.
    """

    def __init__(self, port: serial.SerialBase, clock: Clock, poll_rate: float) -> None:
        """Talk through an open ``port``, asking for the status ``poll_rate`` times a second of ``clock``."""
        self.port, self.clock, self.poll_rate = port, clock, poll_rate
        self.welcome = ""
        self.unit = 1.0  # report units to mm
        self.fault: DeviceError | None = None
        self.notes: list[str] = []
        self.seen = bytearray()  # first bytes ever received, for a person who has to guess the baud rate
        self.last: CncStatus | None = None
        self._statuses: list[CncStatus] = []
        self._offset: np.ndarray | None = None
        self._answer: str | None = None
        self._pushed: list[str] = []
        self._pending = False
        self._late = 0  # answers still due for lines that nobody waits for any more
        self._asked_ns: int | None = None
        self._received_at = time.monotonic()
        self._welcome_expected = True
        self._polled = False
        self._watched = False
        self._stopped = threading.Event()
        self._changed = threading.Condition()
        self._turn = threading.RLock()
        # Reentrant, because a signal handler may send a feed hold while its own thread is writing a line.
        self._writing = threading.RLock()
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Start to listen."""
        self._begin(self._listen, "grbl-listen")

    def poll(self) -> None:
        """Start to ask for the status and to mind silence; from now on a welcome means a lost position."""
        self._welcome_expected, self._polled = False, True
        self.watch(True)
        self._begin(self._ask_regularly, "grbl-poll")

    def stop(self) -> None:
        """End the threads and close the port; never raises."""
        self._stopped.set()
        for thread in self._threads:
            thread.join(timeout=2.0)
        try:
            self.port.close()
        except (serial.SerialException, OSError):
            pass

    def watch(self, watched: bool) -> None:
        """Mind silence or not (a controller that is homing answers nothing); not before `poll`."""
        self._received_at = time.monotonic()
        self._watched = watched and self._polled

    def realtime(self, byte: bytes) -> None:
        """Send a real-time byte at once, past every waiting line; safe from any thread and signal handler."""
        self._write(byte)

    def ask(self) -> None:
        """Ask for the status."""
        self._asked_ns = self._asked_ns or self.clock.now_ns()
        self._write(b"?")

    def command(self, line: str, timeout: float | None) -> tuple[list[str], int, int]:
        """Send a line and wait for its answer.

        Args:
            line: One line without its end.
            timeout: Longest wait [s of the clock]; None waits as long as the controller lives, as a full
                planner or a dwell hold the answer back.

        Returns:
            What was pushed meanwhile, and the times of sending and of the answer [ns].

        Raises:
            DeviceError: If the line is refused, thrown away or not answered, or on a fault.
        """
        with self._turn:
            with self._changed:
                self._answer, self._pushed, self._pending = None, [], True
            sent_ns = self.clock.now_ns()
            try:
                self.check()
                self._write(line.encode("ascii") + b"\n")
                self.wait(lambda: self._answer is not None, timeout, f"an answer to {line!r}")
                self.check()
                answered_ns, answer = self.clock.now_ns(), self._answer or ""
            finally:
                with self._changed:
                    self._pending = False
                    self._late += self._answer is None
        if answer == "ok":
            return self._pushed, sent_ns, answered_ns
        code = RESPONSE.match(answer)
        raise DeviceError(
            f"the controller refused {line!r}: {grbl_codes.error_in_words(int(code[1]))}"
            if code
            else f"the line {line!r} was thrown away by a reset",
            "a line that it accepts in its present state",
            "correct the plan or the controller's settings"
            if code
            else "send it again when the machine is idle",
        )

    def wait(self, reached: Callable[[], bool], timeout: float | None, what: str) -> None:
        """Wait until ``reached()``, ``timeout`` [s of the clock] at most; None: while nothing is wrong.

        Raises:
            DeviceError: On a fault, or when the time is over.
        """
        end = None if timeout is None else deadline(self.clock, timeout)
        with self._changed:
            while not reached():
                self.check()
                if end is not None and time.monotonic() > end:
                    state = self.last.state if self.last else "unknown"
                    raise DeviceError(
                        f"waited {timeout:g} s for {what}; the controller's last state is {state}",
                        "a controller that answers in time",
                        "look at the machine; reset it if it hangs, and record again",
                    )
                self._changed.wait(0.05)

    def take_statuses(self) -> list[CncStatus]:
        """Return the reports received since the last call."""
        with self._changed:
            taken, self._statuses = self._statuses, []
        return taken

    def fresh_status(self, timeout: float) -> CncStatus:
        """Ask and return a report whose query went out after this call began."""
        begun = self.clock.now_ns()
        self.wait(lambda: self._asked_ns is None, timeout, "a status report")
        while True:
            self.ask()
            self.wait(lambda: self._asked_ns is None, timeout, "a status report")
            if self.last and self.last.sent_ns >= begun:
                return self.last

    def soft_reset(self, timeout: float) -> None:
        """Send 0x18 and wait for the welcome that answers it; the caller makes sure that nothing moves."""
        with self._changed:
            self._welcome_expected, self.welcome = True, ""
        self._write(b"\x18")
        self.wait(lambda: bool(self.welcome), timeout, "the welcome after a soft reset")
        self._welcome_expected = not self._polled

    def hear(self, seconds: float) -> bool:
        """Wait at most ``seconds`` [s, real time] for a welcome or a status report; say whether one came."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self.welcome or self.last or self.fault), seconds)

    def check(self) -> None:
        """Raise the fault, if there is one."""
        if self.fault:
            raise DeviceError(self.fault.given, self.fault.allowed, self.fault.remedy)

    def _begin(self, work: Callable[[], None], name: str) -> None:
        thread = threading.Thread(target=work, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _write(self, data: bytes) -> None:
        try:
            with self._writing:
                self.port.write(data)
        except (serial.SerialException, OSError) as error:
            self._break(error)
            self.check()

    def _break(self, error: Exception) -> None:
        self._fail(
            f"the line to the controller on {self.port.port} broke: {error}",
            "a port that stays connected",
            "check the cable and the power; the position is unknown, home or touch off again",
        )

    def _fail(self, given: str, allowed: str, remedy: str) -> None:
        with self._changed:
            self.fault = self.fault or DeviceError(given, allowed, remedy)
            self._changed.notify_all()

    def _ask_regularly(self) -> None:
        while not self._stopped.wait(1.0 / (self.poll_rate * self.clock.rate)):
            waited = time.monotonic() - self._received_at
            if self._watched and waited > max(SILENCE / self.clock.rate, REAL_FLOOR):
                self._fail(
                    f"the controller on {self.port.port} is silent for {waited * self.clock.rate:.1f} s",
                    f"an answer to ? within {SILENCE:g} s",
                    "check power and cable; the position is unknown, home or touch off again",
                )
            # An unanswered query is repeated late only: several before one answer collapse to one.
            if self.fault is None and (self._asked_ns is None or waited > 0.5 * REAL_FLOOR):
                try:
                    self.ask()
                except DeviceError:
                    return

    def _listen(self) -> None:
        buffer = bytearray()
        while not self._stopped.is_set():
            try:
                data = read_available(self.port)
            except (serial.SerialException, OSError, TypeError) as error:
                if not self._stopped.is_set():
                    self._break(error)
                return
            arrival_ns = self.clock.now_ns()
            if not data:
                continue
            self.seen += data[: 64 - len(self.seen)] if len(self.seen) < 64 else b""
            buffer += data
            while (end := buffer.find(b"\n")) >= 0:
                line = bytes(buffer[:end]).decode("ascii", "replace").strip("\r \x00")
                del buffer[: end + 1]
                if line:
                    self._take(line, arrival_ns)
            del buffer[: max(0, len(buffer) - 4096)]

    def _take(self, line: str, arrival_ns: int) -> None:
        with self._changed:
            if line.startswith("<"):
                report = parse_status(line)
                if report:
                    self._take_status(report, arrival_ns)
                else:
                    self.notes.append(f"damaged status report: {line!r}")
            elif RESPONSE.match(line):
                self._take_response(line)
            elif alarm := ALARM.match(line):
                self._fail(
                    f"the controller stopped with {grbl_codes.alarm_in_words(int(alarm[1]))}",
                    "motion without an alarm",
                    "free the machine by hand if need be, then home or unlock it and record again",
                )
            elif WELCOME.search(line):
                self._take_welcome(line)
            elif self._pending:
                self._pushed.append(line)
            else:
                self.notes.append(line)
            del self.notes[:-200]
            self._changed.notify_all()

    def _take_response(self, line: str) -> None:
        if self._late:
            self._late -= 1
        elif self._pending and self._answer is None:
            self._answer = line
        else:
            self.notes.append(f"unasked {line}")

    def _take_welcome(self, line: str) -> None:
        self.welcome, self._late, self._asked_ns = line, 0, None
        if self._pending:
            self._answer = "reset"
        if not self._welcome_expected:
            self._fail(
                f"the controller was reset in mid-stream (it said {line!r}); its position is lost",
                "one welcome, when the port is opened",
                "check its power supply and cable (a brown-out does this); home or touch off again",
            )

    def _take_status(self, report: StatusReport, arrival_ns: int) -> None:
        self._received_at = time.monotonic()
        sent_ns, self._asked_ns = self._asked_ns, None
        if report.offset is not None:
            self._offset = report.offset
        if report.is_work and self._offset is None:
            return  # a work position without its offset is no machine position
        position = (
            report.position + self._offset if report.is_work and self._offset is not None else report.position
        )
        if (
            sent_ns is None
        ):  # an answer to a query that was given up, or unasked: no younger than the report before
            sent_ns = self.last.arrival_ns if self.last else arrival_ns
        self.last = CncStatus(
            sent_ns, arrival_ns, report.state, position * self.unit, report.feed * self.unit
        )
        self._statuses.append(self.last)


def inches_to_mm(reports_inches: bool) -> float:
    """Return the factor from report units to mm (``$13``)."""
    return MM_PER_INCH if reports_inches else 1.0
