"""The clock of a device that answers queries: each answer's time is between query and receipt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PolledClock:
    """Clock of a polled stream: sample time = middle of query and answer, error at most half the round trip."""

    reports: int
    """Answers used [count]."""
    round_trip_ns: float
    """Median time from query to answer [ns]."""
    longest_ns: float
    """Longest of them [ns]."""
    jitter_ns: float
    """Their standard deviation [ns]."""

    @property
    def document(self) -> dict[str, str]:
        """The clock as MCAP metadata."""
        return {
            "method": "middle of query and answer",
            "frames": str(self.reports),
            "round_trip_ns": f"{self.round_trip_ns:.0f}",
            "longest_ns": f"{self.longest_ns:.0f}",
            "jitter_ns": f"{self.jitter_ns:.0f}",
            "uncertainty_ns": f"{self.round_trip_ns / 2:.0f}",
        }


def polled_clock(sent_ns: np.ndarray, arrival_ns: np.ndarray) -> PolledClock | None:
    """Return the clock from queries sent [ns], shape (n,), and their answers' arrivals [ns], shape (n,)."""
    trip = np.asarray(arrival_ns, np.int64) - np.asarray(sent_ns, np.int64)
    if not len(trip):
        return None
    return PolledClock(len(trip), float(np.median(trip)), float(trip.max()), float(trip.std()))
