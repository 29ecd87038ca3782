"""A stream's clock: the device's counter against the host's clock, fitted at the arrivals' lower envelope.

A frame k leaves the device at ``offset + period k`` and arrives a delay d_k >= 0 later. Delays only ever add,
so the line through the least delayed arrivals estimates the sample times up to the smallest delay of the
link; a least squares line would be late by the mean delay (9 ms behind an FTDI adapter, whose latency timer
is 16 ms). The line is the one below all points with the smallest sum of distances: the edge of their lower
convex hull under the mean counter (Moon, Skelly and Towsley, INFOCOM 1999). The smallest delay itself cannot
be seen from arrivals and stays as a constant, about 1 ms over USB; only an event seen by two streams tells
it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

BLOCK_NS = 60_000_000_000
"""Stretch of arrivals summarized by one hull [ns]."""
BLOCKS = 10
"""Stretches that a running fit remembers: ten minutes, within which drift is a line."""


@dataclass(frozen=True)
class ClockModel:
    """Sample time = reference + period (counter - first counter)."""

    first_counter: int
    """Counter at the reference [frames]."""
    reference_ns: int
    """Estimated host time of that frame's sampling [ns]."""
    period_ns: float
    """Frame period on the host's clock [ns]."""
    frames: int
    """Arrivals behind the fit."""

    def sample_ns(self, counter: np.ndarray) -> np.ndarray:
        """Return the estimated sample times [ns], shape (n,), int64, of counters [frames], shape (n,)."""
        elapsed = np.asarray(counter, dtype=np.int64) - self.first_counter
        return self.reference_ns + np.rint(self.period_ns * elapsed).astype(np.int64)

    def sample_of(self, counter: int) -> int:
        """Return the estimated sample time [ns] of one counter [frames]."""
        return int(self.sample_ns(np.array([counter]))[0])

    @property
    def document(self) -> dict[str, str]:
        """The model as MCAP metadata."""
        return {
            "method": "lower envelope of arrival against counter",
            "first_counter": str(self.first_counter),
            "reference_ns": str(self.reference_ns),
            "period_ns": repr(self.period_ns),
            "frames": str(self.frames),
            "remaining": "the link's smallest delay, constant and unknown",
        }

    @classmethod
    def from_document(cls, document: dict[str, str]) -> ClockModel:
        """Rebuild a model from `document`; raises KeyError or ValueError if it is damaged."""
        return cls(
            int(document["first_counter"]),
            int(document["reference_ns"]),
            float(document["period_ns"]),
            int(document["frames"]),
        )


Point = tuple[int, int]


def lower_hull(points: list[Point]) -> list[Point]:
    """Return the lower convex hull of (counter, arrival) points, sorted by counter; integers, so exact."""
    hull: list[Point] = []
    for point in sorted(points):
        if hull and hull[-1][0] == point[0]:
            continue  # sorted: the earlier arrival of a repeated counter came first
        while len(hull) >= 2:
            (x1, y1), (x2, y2) = hull[-2:]
            if (x2 - x1) * (point[1] - y1) > (y2 - y1) * (point[0] - x1):
                break
            hull.pop()
        hull.append(point)
    return hull


class EnvelopeFit:
    """A fit that goes on while frames arrive; memory and time stay small, as only hulls are kept."""

    def __init__(self) -> None:
        self._blocks: list[list[Point]] = []
        self._sums: list[tuple[int, int, int]] = []  # frames, sum of counters, first arrival

    def add(self, arrival_ns: int, counter: int) -> None:
        """Take one arrival [ns]; a counter that falls back (a reset device) starts the fit anew."""
        if counter < 0:
            return
        if self._blocks and counter < self._blocks[-1][0][0]:
            self._blocks, self._sums = [], []
        if not self._blocks or arrival_ns - self._sums[-1][2] > BLOCK_NS:
            self._blocks = [*self._blocks[-BLOCKS + 1 :], []]
            self._sums = [*self._sums[-BLOCKS + 1 :], (0, 0, arrival_ns)]
        block = self._blocks[-1]
        block.append((counter, arrival_ns))
        frames, total, start = self._sums[-1]
        self._sums[-1] = (frames + 1, total + counter, start)
        if len(block) > 512:
            self._blocks[-1] = lower_hull(block)

    def model(self) -> ClockModel | None:
        """Return the model of what has arrived, or None before two different counters are known."""
        hull = lower_hull([point for block in self._blocks for point in block])
        frames = sum(entry[0] for entry in self._sums)
        if len(hull) < 2:
            return None
        mean = sum(entry[1] for entry in self._sums) / frames
        edge = next((i for i in range(1, len(hull) - 1) if hull[i][0] >= mean), len(hull) - 1)
        (x1, y1), (x2, y2) = hull[edge - 1], hull[edge]
        period = (y2 - y1) / (x2 - x1)
        if not (math.isfinite(period) and period > 0):
            return None
        return ClockModel(x1, y1, period, frames)


def fit(arrival_ns: np.ndarray, counter: np.ndarray) -> ClockModel | None:
    """Fit a whole stream at once.

    Args:
        arrival_ns: Host times of receipt [ns], shape (n,).
        counter: Device counters [frames], shape (n,); -1 without one.
    """
    running = EnvelopeFit()
    for arrival, count in zip(np.asarray(arrival_ns).tolist(), np.asarray(counter).tolist(), strict=True):
        running.add(arrival, count)
    return running.model()
