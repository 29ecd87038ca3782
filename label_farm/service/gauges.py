"""History of the service: presses settled in each minute, and the workers' use of their computers."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Lock
from typing import Any

from tacdata.label_farm.workers.usage import Usage, local_process, usage_of

KEPT = 1440
"""Minutes that are remembered: a day. They start empty with each service."""
SHOWN = 60
"""Minutes that the page shows."""


@dataclass
class Minute:
    """Presses that were settled within one minute."""

    number: int
    """Minutes since 1970."""
    solved: int = 0
    failed: int = 0

    @property
    def document(self) -> dict[str, Any]:
        """As JSON; ``begin`` is the minute's first moment, ISO 8601."""
        begin = datetime.fromtimestamp(60 * self.number, UTC).isoformat()
        return {"begin": begin, "solved": self.solved, "failed": self.failed}


@dataclass(frozen=True)
class _Sample:
    at: float
    usage: Usage
    share: float | None


class Gauges:
    """Throughput by the minute, and each worker's share of a processor and its memory. Any thread may call."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        """Begin with nothing; ``clock`` gives the time [s since 1970]."""
        self._now, self._lock = clock, Lock()
        self._minutes: deque[Minute] = deque(maxlen=KEPT)
        self._totals: tuple[int, int] | None = None
        self._samples: dict[str, _Sample] = {}

    def count(self, solved: int, failed: int) -> None:
        """Take the ledger's totals; the increase since the last call belongs to this minute."""
        with self._lock:
            number = int(self._now() // 60)
            # Presses settled before this service belong to none of its minutes.
            previous = self._totals or (solved, failed)
            self._totals = solved, failed
            # Minutes without a press are listed as 0, so that the series has no gaps.
            while not self._minutes or self._minutes[-1].number < number:
                self._minutes.append(Minute(self._minutes[-1].number + 1 if self._minutes else number))
            # A cancelled submission takes jobs out of the ledger: totals may fall.
            self._minutes[-1].solved += max(0, solved - previous[0])
            self._minutes[-1].failed += max(0, failed - previous[1])

    def measure(self, owners: Iterable[str]) -> None:
        """Look at the workers of this computer; forget those that are not named any more."""
        named = list(owners)
        for owner in named:
            process = local_process(owner)
            if process is not None and (usage := usage_of(process)) is not None:
                self.tell(owner, usage)
        with self._lock:
            self._samples = {owner: self._samples[owner] for owner in named if owner in self._samples}

    def tell(self, owner: str, usage: Usage) -> None:
        """Take a worker's own report, or its measured use."""
        with self._lock:
            at, previous = self._now(), self._samples.get(owner)
            passed = at - previous.at if previous else 0.0
            share = (usage.processor - previous.usage.processor) / passed if previous and passed > 0 else None
            self._samples[owner] = _Sample(at, usage, share)

    def usage(self, owner: str) -> dict[str, float | int | None]:
        """Return a worker's share of one processor [1], its time of the processor [s] and memory [bytes], or None."""
        with self._lock:
            sample = self._samples.get(owner)
        if sample is None:
            return {"processor": None, "processor_seconds": None, "memory": None}
        used = sample.usage
        return {"processor": sample.share, "processor_seconds": used.processor, "memory": used.memory}

    def throughput(self, limit: int = KEPT) -> list[dict[str, Any]]:
        """Return the counts of the last minutes, the oldest first."""
        with self._lock:
            return [minute.document for minute in list(self._minutes)[-limit:]]
