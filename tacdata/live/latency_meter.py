"""Measures the age of estimates when they are sent."""

from collections import deque
from dataclasses import dataclass

import numpy as np

KEPT = 2000
"""Estimates in the statistics [count]."""


@dataclass(frozen=True)
class LatencyFigures:
    """Statistics of the latest estimates."""

    count: int
    """Estimates since the beginning."""
    rate: float
    """Estimates a second [Hz]."""
    age: tuple[float, float, float]
    """From sampling to sending: median, 95th percentile, largest [ms]."""
    computing: tuple[float, float, float]
    """From the newest frame's arrival to sending: median, 95th percentile, largest [ms]."""

    @property
    def text(self) -> str:
        """The statistics in one line."""
        age, computing = self.age, self.computing
        return (
            f"{self.count} estimates at {self.rate:.1f} Hz; age from sampling to sending {age[0]:.1f} ms median, "
            f"{age[1]:.1f} 95 %, {age[2]:.1f} largest; from arrival {computing[0]:.2f} ms median, "
            f"{computing[1]:.2f} 95 %, {computing[2]:.2f} largest"
        )


class LatencyMeter:
    """Takes three time stamps per estimate."""

    def __init__(self) -> None:
        self._times: deque[tuple[int, int, int]] = deque(maxlen=KEPT)
        self._count = 0

    def take(self, sample_ns: int, arrival_ns: int, sent_ns: int) -> None:
        """Take the frame's sample time, the newest frame's arrival, and the time of sending [ns]."""
        self._times.append((sample_ns, arrival_ns, sent_ns))
        self._count += 1

    @property
    def figures(self) -> LatencyFigures | None:
        """The statistics; None before two estimates."""
        if len(self._times) < 2:
            return None
        sample, arrival, sent = np.array(self._times, np.int64).T
        rate = (len(sent) - 1) / max((sent[-1] - sent[0]) * 1e-9, 1e-9)
        return LatencyFigures(self._count, float(rate), _summary(sent - sample), _summary(sent - arrival))


def _summary(values_ns: np.ndarray) -> tuple[float, float, float]:
    low, high, top = (float(v) * 1e-6 for v in np.quantile(values_ns, [0.5, 0.95, 1.0]))
    return low, high, top
