"""How far two streams of a recording may be off in time: offset and uncertainty of every pair, or "not measured"."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

from tacdata.recording.clocks.clock_model import StreamLatency

MOTION = "motion"
"""The stream that sync taps measure the others against."""
NOT_MEASURED = "not measured"


@dataclass(frozen=True)
class StreamPair:
    """Two streams, and the constant delay between them as a sync tap measured it.

    Example:
        ``stream_pairs({"taxels": StreamLatency(6_100_000, 300_000)})[0].words`` is ``+6.10 +- 0.30 ms, taken off``.
    """

    first: str
    second: str
    offset: float | None = None
    """How much later the first stream comes [ms]; taken off its times. None if it was not measured."""
    uncertainty: float | None = None
    """Of the offset [ms], one standard deviation."""

    @property
    def name(self) -> str:
        """``FIRST - SECOND``."""
        return f"{self.first} - {self.second}"

    @property
    def words(self) -> str:
        """Offset and uncertainty, or that they were not measured."""
        if self.offset is None:
            return NOT_MEASURED
        return f"{self.offset:+.2f} +- {self.uncertainty:.2f} ms, taken off"


def stream_pairs(latencies: dict[str, StreamLatency | None], motion: bool = True) -> tuple[StreamPair, ...]:
    """Return every pair of streams.

    Args:
        latencies: Constant latency of each stream, or None.
        motion: Whether the recording holds a motion, too; latencies are measured against it.
    """
    reference = {MOTION: StreamLatency(0, 0)} if motion else {}
    # Motion comes last, so that offsets are those of a stream against the motion.
    ordered = {**dict(sorted(latencies.items())), **reference}
    return tuple(_pair(first, second, ordered[first], ordered[second]) for first, second in combinations(ordered, 2))


def _pair(
    first: str, second: str, first_latency: StreamLatency | None, second_latency: StreamLatency | None
) -> StreamPair:
    if first_latency is None or second_latency is None:
        return StreamPair(first, second)
    offset = (first_latency.latency_ns - second_latency.latency_ns) / 1e6
    return StreamPair(
        first, second, offset, math.hypot(first_latency.uncertainty_ns, second_latency.uncertainty_ns) / 1e6
    )
