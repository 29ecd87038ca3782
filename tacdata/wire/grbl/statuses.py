"""Converts status reports to machine positions in mm, with the times that bracket them."""

from __future__ import annotations

from collections import deque

import numpy as np

from tacdata.clock import Clock
from tacdata.wire.delivered import CncStatus
from tacdata.wire.grbl.lines import StatusReport

REPORT_LAG_NS = 50_000_000
"""Longest time from making a report to its arrival [ns]: Grbl looks for queries every 50 ms of a pause."""
REPEAT = 0.5
"""An unanswered query is repeated after this time [s, real time].

Several queries may get one common answer. When no second answer has come after this time, none will.
"""


class Statuses:
    """The reports of one connection; the caller guards it with a lock.

    The position was read between ``sent_ns`` (the query left the host) and ``arrival_ns``. To be certain of that, no
    query goes out while another may be unanswered, and a report after a repeated query counts as the first one's
    answer. An unsolicited report (auto-reporting) was made after the one before it.
    """

    def __init__(self, clock: Clock) -> None:
        """Create it without a report."""
        self._clock = clock
        self.unit = 1.0
        """Report units to mm."""
        self.offset: np.ndarray | None = None
        """Work coordinate offset [report units], shape (3,); needed only where work positions are reported."""
        self.automatic = False
        """Whether the controller reports by itself; it then leaves ``?`` unanswered (grblHAL, ``$481``)."""
        self.last: CncStatus | None = None
        self.unplaced = ""
        """State of the latest report whose work position lacks a known offset; empty otherwise."""
        self.homed: bool | None = None
        """Whether it was homed since it was switched on, by the latest report that states it."""
        self.damaged = 0
        """Reports that could not be read [count]."""
        self._tells_offset = self._is_work = False  # whether a report has contained it; whether they are work positions
        self._queries: deque[int] = deque()  # when those went out that may not be answered yet [ns]
        self._asked_at = self._answered_at = 0.0
        self._answered = False  # whether a report has come since the latest query
        self._waiting: list[CncStatus] = []

    @property
    def asked_ns(self) -> int | None:
        """When the unanswered query went out [ns]; the first, if it was repeated."""
        return self._queries[0] if self._queries else None

    def ask(self) -> bool:
        """Return whether to send a query now, and count it as sent."""
        instant = self._clock.host.monotonic()
        if self._queries and instant - max(self._asked_at, self._answered_at) <= REPEAT:
            return False
        if self._answered:
            self._queries.clear()  # repeated queries without an answer by now were answered together
        self._queries.append(self._clock.now_ns())
        self._asked_at, self._answered = instant, False
        return True

    def forget(self) -> None:
        """Forget all queries, and an offset that no report states. A reset changes it."""
        self._queries.clear()
        if not self._tells_offset and self._is_work:
            self.offset, self.unplaced = None, "Idle"

    def place(self, offset: np.ndarray | None) -> None:
        """Take the offset [report units], shape (3,), unless reports state it."""
        if offset is not None and not self._tells_offset:
            self.offset, self.unplaced = offset, ""

    def spoilt(self) -> None:
        """Take that a report cannot be read. The next query need not wait."""
        self.damaged += 1
        if self._queries:
            self._queries.popleft()
        self._answered_at, self._answered = self._clock.host.monotonic(), True

    def take(self, report: StatusReport, arrival_ns: int) -> CncStatus | None:
        """Take a report; return it in mm, or None if its position cannot be known yet."""
        # Reports carry no name; they are answered in the order of the queries. The bracket from query to arrival holds
        # the time of the position.
        sent_ns = self._queries.popleft() if self._queries else None
        self._answered_at, self._answered = self._clock.host.monotonic(), True
        self.homed = self.homed if report.homed is None else report.homed
        if report.offset is not None:
            self.offset, self._tells_offset = report.offset, True
        self._is_work = report.is_work
        self.unplaced = report.state if report.is_work and self.offset is None else ""
        if self.unplaced:
            return None  # a work position without its offset is no machine position
        # Nobody asked for this report. It can be as old as the one before it, and not older.
        if sent_ns is None or self.automatic:
            sent_ns = (self.last.arrival_ns if self.last else arrival_ns) - REPORT_LAG_NS
        position = report.position + self.offset if report.is_work and self.offset is not None else report.position
        self.last = CncStatus(sent_ns, arrival_ns, report.state, position * self.unit, report.feed * self.unit)
        self._waiting.append(self.last)
        return self.last

    def collect(self) -> list[CncStatus]:
        """Return the reports taken since the last call."""
        reports, self._waiting = self._waiting, []
        return reports
