"""The conversation with a GRBL controller: lines answered one by one, real-time bytes, polled status."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import serial

from tacdata.clock import Clock
from tacdata.errors import DeviceError
from tacdata.wire.delivered import CncStatus
from tacdata.wire.grbl import codes
from tacdata.wire.grbl.answers import ECHO, UNASKED_ANSWER, SentLine, changed_on_its_way, refusal
from tacdata.wire.grbl.lines import ALARM, RESPONSE, WELCOME, StatusReport, parse_status
from tacdata.wire.grbl.owed import Owed
from tacdata.wire.grbl.silence import Silence
from tacdata.wire.grbl.statuses import Statuses
from tacdata.wire.grbl.watch import PENDANT, WELCOME_IN_MID_STREAM, stopped_by, what_is_wrong
from tacdata.wire.serial_port import read_available, why_broken, write_all

LINE_BYTES = 79
"""Longest line that Grbl 1.1 takes [bytes without its end] (``LINE_BUFFER_SIZE`` 80; grblHAL takes 256)."""
RX_BYTES = 128
"""Size of the receive buffer until the controller states its own [bytes]; Grbl 1.1's."""
PUSHED = ("[", "$", ">")
"""First characters of a line that is no report and no answer; any other line is noise, or a report that lost bytes."""
READ_FAILED = "error:7"
"""Sent by ``$#`` and ``$N`` for each entry that cannot be read, before their own answer."""


class GrblLink:
    """One open line to a controller, with a reading and a polling thread.

    Each line is answered once, in order, and only ``ok`` or ``error:N`` alone on a line is an answer. A line goes out
    only when it fits into the free part of the receive buffer.

    A permanent fault (alarm, unexpected welcome, broken line, silence) is kept as `fault` and raised by
    every later call. A mere interruption (a hold, the door) is kept as `interruption` until `rearm`.
    """

    def __init__(self, port: serial.SerialBase, clock: Clock, poll_rate: float) -> None:
        """Talk through an open ``port``, asking for the status ``poll_rate`` times a second of ``clock``."""
        self.port, self.clock, self.poll_rate = port, clock, poll_rate
        self.welcome = ""
        self.resets = 0  # welcomes that answer no soft reset of ours
        self.rx_bytes = RX_BYTES
        self.fault: DeviceError | None = None
        self.lost = ""
        """Why the position is not known any more, in words; empty while it is."""
        self.echoes = False
        """Whether the controller sends received lines back, so that they can be compared."""
        self.halted = False
        """Whether the controller itself has ended all motion: an alarm, a restart, motors switched off."""
        self.alarm: int | None = None
        """Number of the latest alarm, as far as it was reported; None once a report shows another state."""
        self.pendant = False
        """Whether a pendant has control, by the latest report that states it."""
        self.interruption: DeviceError | None = None
        self._unasked = False  # whether an answer came that no line waited for
        self.notes: list[str] = []
        self.seen = bytearray()  # first bytes ever received, for a person who has to guess the baud rate
        self.statuses = Statuses(clock)
        self.homing = self.polled = self._held = False
        self._unanswered: deque[SentLine] = deque()
        self.silence = Silence(port, clock, poll_rate)
        self._commanded_ns = clock.now_ns()
        self._welcome_expected, self._reset_asked = True, False
        self._stopped, self._changed = clock.host.event(), clock.host.condition()
        self._turn = clock.host.lock()  # answers carry no name: lines are written in the order in which they wait
        self._writing = clock.host.lock()  # reentrant: a signal handler may send a hold while its thread writes
        self._threads: list[Any] = []

    @property
    def last(self) -> CncStatus | None:
        """The latest report."""
        return self.statuses.last

    @property
    def waiting(self) -> bool:
        """Whether a line still waits for its answer."""
        return bool(self._unanswered)

    @property
    def at_rest(self) -> bool:
        """Whether the latest report is Idle and no line went out since."""
        last = self.last
        return last is not None and last.state == "Idle" and last.sent_ns > self._commanded_ns

    def start(self) -> None:
        """Start to read."""
        self._begin(self._listen, "grbl-listen")

    def poll(self) -> None:
        """Start to poll the status and to watch for silence; from now on a welcome means a lost position."""
        self._welcome_expected, self.polled = False, True
        self.silence.hold()
        self._begin(self._ask_regularly, "grbl-poll")

    def stop(self) -> None:
        """End the threads and every wait, and close the port; never raises."""
        self._stopped.set()
        self._fail(f"the controller on {self.port.port} was closed", "an open one", "open it again")
        for thread in self._threads:
            thread.join(timeout=2.0)
        with suppress(serial.SerialException, OSError):
            self.port.close()

    def realtime(self, byte: bytes) -> None:
        """Send a real-time byte at once, before all waiting lines; safe in any thread and signal handler."""
        self._write(byte)

    def hold(self) -> None:
        """Send ``!``; until `rearm` no line goes out, and everyone who waits for an answer gets an error."""
        self._held = True  # first: a report of it may come before this thread goes on
        try:
            self._write(b"!")
        finally:
            with self._changed:
                self._changed.notify_all()

    def rearm(self) -> None:
        """Accept lines again after a hold or an interruption."""
        with self._changed:
            self._held, self.interruption = False, None

    def ask(self) -> None:
        """Query the status, unless an answer is pending."""
        with self._changed:
            due = self.statuses.ask()
        if due:
            self._write(b"?")

    def command(self, line: str, limit: float, motion: float = 0.0) -> tuple[list[str], int, int]:
        """Send a line and wait for its answer.

        Args:
            line: One line without its end.
            limit: Timeout [s of the clock].
            motion: Longest duration of the motion and pauses before the answer [s of the clock]. If the controller is
                idle after that and has not answered, the wait ends (`Owed`).

        Returns:
            The lines pushed meanwhile, and the times of sending and of the answer [ns].

        Raises:
            DeviceError: If the line is too long, refused or not answered, on a fault, an interruption or a hold.
        """
        data = line.encode("ascii") + b"\n"
        if len(data) > min(LINE_BYTES + 1, self.rx_bytes):
            raise DeviceError(
                f"a line of {len(line)} bytes for the controller: {line[:40]!r}...",
                f"at most {min(LINE_BYTES + 1, self.rx_bytes) - 1} bytes, as its buffers hold no more",
                "shorten the line",
            )
        entry = SentLine(line)
        with self._turn:
            room = Owed("room in the controller's receive buffer", limit, motion)
            self.wait(lambda: self._room() >= len(data), room)  # Grbl silently drops bytes when its buffer is full
            with self._changed:
                self._unanswered.append(entry)  # before the line is written: its answer may come at once
            sent_ns = self._commanded_ns = self.clock.now_ns()
            self._write(data)
        # Replies to a query are expected; lines that come in answer to a move explain why it was not carried out.
        heard = () if line.startswith("$") else entry.pushed
        self.wait(lambda: entry.answer is not None, Owed(f"an answer to {line!r}", limit, motion, heard, True))
        answered_ns = self.clock.now_ns()
        if wrong := refusal(line, entry.answer or ""):
            raise wrong
        return entry.pushed, sent_ns, answered_ns

    def wait(self, reached: Callable[[], bool], owed: Owed, through_hold: bool = False) -> None:
        """Wait until ``reached()``; with ``through_hold`` only a fault ends the wait, not a hold or an interruption.

        Raises:
            DeviceError: On a fault, an interruption or a hold, or when the awaited answer can no longer come.
        """
        watch = owed.watch(self.clock)
        while True:
            with self._changed:
                self.check(through_hold)
                if reached():
                    return
                if overdue := watch.ending(self.last, self.silence.late):
                    raise DeviceError(*PENDANT) if self.pendant else overdue
                self._changed.wait(0.05)
            if not self.polled:  # nobody else asks before polling begins
                self.ask()

    def write_off(self) -> None:
        """Expect no more answers to the lines so far."""
        with self._changed:
            self._unanswered.clear()

    def take_statuses(self) -> list[CncStatus]:
        """Return the reports received since the last call."""
        with self._changed:
            return self.statuses.collect()

    def fresh_status(self, timeout: float) -> CncStatus:
        """Ask and return a report whose query went out after this call began; a hold does not stop this.

        Raises:
            DeviceError: On a fault, or when the time is over.
        """
        # A report on its way may be older than the call, and would show the machine before the event.
        begun, watch = self.clock.now_ns(), Owed("a status report", timeout).watch(self.clock)
        while True:
            self.ask()
            with self._changed:
                self.check(through_hold=True)
                if self.last and self.last.sent_ns >= begun:
                    return self.last
                if overdue := watch.ending(self.last, self.silence.late):
                    raise overdue
                if self.statuses.asked_ns is not None or self.statuses.automatic:
                    self._changed.wait(0.05)

    def soft_reset(self, timeout: float, late: float = 0.0) -> None:
        """Send 0x18 at rest and wait for the welcome; another may come for ``late`` [s, real time] after it."""
        with self._changed:
            self._welcome_expected, self._reset_asked, self.welcome = True, True, ""
        self._write(b"\x18")
        try:
            self.wait(lambda: bool(self.welcome), Owed("the welcome after a soft reset", timeout), through_hold=True)
            self.clock.host.sleep(late)
        finally:  # one that was interrupted is still answered
            self._welcome_expected, self._reset_asked = not (self.polled and self.welcome), not self.welcome

    def hear(self, seconds: float) -> bool:
        """Wait at most ``seconds`` [s, real time] for a welcome or a status report; return whether one came."""
        with self._changed:
            signs = lambda: self.welcome or self.last or self.statuses.unplaced or self.fault  # noqa: E731
            return bool(self._changed.wait_for(signs, seconds))

    def check(self, through_hold: bool = False) -> None:
        """Raise the fault, the interruption or the hold, if there is one; ``through_hold``: only the fault."""
        wrong = self.fault or (None if through_hold else self.interruption)
        if wrong:
            # A new error for each thread, with its own notes.
            raise DeviceError(wrong.given, wrong.allowed, wrong.remedy)
        if self._held and not through_hold:
            raise DeviceError("the motion was stopped by a feed hold", "a running machine", "start again")

    def _room(self) -> int:
        return self.rx_bytes - sum(len(line.text) + 1 for line in self._unanswered)

    def _begin(self, work: Callable[[], None], name: str) -> None:
        thread = self.clock.host.thread(work, name)
        self._threads.append(thread)
        thread.start()

    def _write(self, data: bytes) -> None:
        try:
            with self._writing:
                write_all(self.port, data)
        except (serial.SerialException, OSError) as error:
            self._break(error)
            raise DeviceError(*self._broken(error)) from None

    def _broken(self, error: Exception) -> tuple[str, str, str]:
        return (
            f"the line to the controller on {self.port.port} broke: {why_broken(error)}",
            "a port that stays connected",
            "check the cable and the power; the position is unknown, home or touch off again",
        )

    def _break(self, error: Exception) -> None:
        self._fail(*self._broken(error), lost=True)

    def _fail(self, cause: str, allowed: str, remedy: str, lost: bool = False) -> None:
        """Keep the first fault; ``lost``: the position is unknown after it."""
        with self._changed:
            if self.fault is None:
                self.fault = DeviceError(cause, allowed, remedy)
            if lost and not self._stopped.is_set():
                self.lost = self.lost or cause
            self._changed.notify_all()

    def _ask_regularly(self) -> None:
        while not self._stopped.wait(1.0 / (self.poll_rate * self.clock.rate)):
            if self.homing:  # its own timeout ends it
                self.silence.hold()
            elif ending := self.silence.ending():
                error, lost = ending
                if lost:
                    self._fail(error.given, error.allowed, error.remedy, lost)
                self.interruption = self.interruption or error
            if self.fault is None:
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
            self.silence.look(bool(data))
            if not data:
                continue
            self.seen += data[: 64 - len(self.seen)] if len(self.seen) < 64 else b""
            buffer += data.replace(b"\r", b"\n")  # some firmwares end lines with one, some with the other
            while (end := buffer.find(b"\n")) >= 0:
                line = bytes(buffer[:end]).decode("ascii", "replace").strip("\r \x00")
                del buffer[: end + 1]
                if line:
                    self._take(line, arrival_ns)
            if len(buffer) > LINE_BYTES:  # noise may hold no end of a line
                self.silence.unread = bytes(buffer[:LINE_BYTES]).decode("ascii", "replace")
            # Noise without a line end must not fill the memory during a night.
            del buffer[: max(0, len(buffer) - 4096)]

    def _take(self, line: str, arrival_ns: int) -> None:
        changed = None
        with self._changed:
            if line.startswith("<"):
                report = parse_status(line)
                if report:
                    self._take_status(report, arrival_ns)
                else:
                    self.silence.unread = line
                    self.statuses.spoilt()
                    self.notes.append(f"damaged status report: {line!r}")
            elif RESPONSE.match(line):
                self._take_response(line)
            elif alarm := ALARM.match(line):
                self._take_alarm(line, int(alarm[1]) if alarm[1] else None)
            elif WELCOME.search(line):
                self._take_welcome(line)
            elif self._unanswered and (echo := ECHO.match(line)):
                changed = changed_on_its_way(self._unanswered[0].text, echo[1])
                self.echoes = True
                self.interruption = self.interruption or changed
            else:
                if not line.startswith(PUSHED):
                    self.silence.unread = line
                (self._unanswered[0].pushed if self._unanswered else self.notes).append(line)
            del self.notes[:-200]
            self._changed.notify_all()
        if changed:
            with suppress(DeviceError):  # a broken line is known already
                self.hold()

    def _take_alarm(self, line: str, number: int | None) -> None:
        self.alarm = number
        # At its start grblHAL reports why it is locked; opening informs a person.
        deaf = number in codes.DEAF and not (self.last and self.last.state.startswith("Alarm"))
        if self.polled or self.homing or deaf:  # deaf from now on: no answer comes
            self.halted = True
            self._fail(*stopped_by(number, line), lost=number not in codes.POSITION_KEPT)

    def _take_response(self, line: str) -> None:
        if not self._unanswered:
            self.notes.append(f"unasked {line}")
            if self.polled and not self._welcome_expected and not self._unasked:
                self._unasked, cause = True, UNASKED_ANSWER[0].format(line)  # once: the lift must go through
                self.interruption = self.interruption or DeviceError(cause, *UNASKED_ANSWER[1:])
        elif line == READ_FAILED and self._unanswered[0].text.startswith("$"):
            self._unanswered[0].pushed.append(line)
        else:
            self._unanswered.popleft().answer = line

    def _take_welcome(self, line: str) -> None:
        self.welcome = line
        self.statuses.forget()
        self.resets += not self._reset_asked
        while self._unanswered:  # a reset empties the receive buffer: no earlier line is answered any more
            self._unanswered.popleft().answer = "reset"
        if not self._welcome_expected:
            cause, allowed, remedy = WELCOME_IN_MID_STREAM
            self.halted = True
            self._fail(cause.format(line), allowed, remedy, lost=True)

    def _take_status(self, report: StatusReport, arrival_ns: int) -> None:
        self.silence.restart()
        self.pendant = self.pendant if report.pendant is None else report.pendant  # grblHAL states changes only
        again = self.last is not None and self.last.state == report.state
        place = self.last.position if again and self.last else None
        # The number comes with the alarm's own line or as a substate. A later report without it must not erase it.
        number = report.state.partition(":")[2]
        self.alarm = None if report.state[:5] != "Alarm" else int(number) if number else self.alarm
        self.statuses.take(report, arrival_ns)
        if self.polled and not self._welcome_expected:
            # Two reports of one place: a machine that brakes still moves.
            still = bool(place is not None and self.last and (place == self.last.position).all())
            wrong, for_good = what_is_wrong(report, self._held, self.homing, again, still)
            if wrong and for_good:
                self.halted = True
                self._fail(*wrong, lost=self.fault is None)  # an alarm's own line, if it came first, reported the loss
            elif wrong and self.interruption is None:
                self.interruption = DeviceError(*wrong)
