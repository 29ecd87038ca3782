"""How far two streams of a recording may be off in time, in words that stand in its file."""

from __future__ import annotations

import math
from itertools import combinations

from tacdata.recording.clocks.clock_model import StreamLatency

MOTION = "motion"
"""The stream that sync taps measure the others against."""
NOT_MEASURED = "not measured (record --sync-tap)"


def stream_pairs(latencies: dict[str, StreamLatency | None]) -> dict[str, str]:
    """Return offset and uncertainty of every pair of streams [ms], by "FIRST - SECOND"; the offsets are taken off.

    Args:
        latencies: Constant latency of each stream beside the motion, measured by a sync tap, or None.

    Example:
        ``stream_pairs({"taxels": StreamLatency(6_100_000, 300_000)})["taxels - motion"]`` is
        ``+6.10 +- 0.30 ms, taken off``.
    """
    found = {f"{name} - {MOTION}": _words(latency, StreamLatency(0, 0)) for name, latency in latencies.items()}
    for first, second in combinations(sorted(latencies), 2):
        found[f"{first} - {second}"] = _words(latencies[first], latencies[second])
    return found


def _words(first: StreamLatency | None, second: StreamLatency | None) -> str:
    if first is None or second is None:
        return NOT_MEASURED
    offset = (first.latency_ns - second.latency_ns) / 1e6
    uncertainty = math.hypot(first.uncertainty_ns, second.uncertainty_ns) / 1e6
    return f"{offset:+.2f} +- {uncertainty:.2f} ms, taken off"
