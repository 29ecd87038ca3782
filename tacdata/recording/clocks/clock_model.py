"""The clock of a stream: a line from the device's counter to the host's clock, stored in the file.

A frame k leaves the device at ``offset + period k`` and arrives after a latency d_k >= 0. Latencies only add. So the
line under the earliest arrivals (`envelope_fit`) gives the sample times up to the link's minimum latency.

That minimum is constant and cannot be seen from arrivals. A sync tap (`sync_tap`) measures it, and the model carries it
with its uncertainty. A device that restarts or steps begins a new line; the earlier ones stay.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class StreamLatency:
    """The constant part of a stream's latency, which arrivals alone do not show."""

    latency_ns: int
    """From sampling to the fitted line [ns]."""
    uncertainty_ns: int
    """Its standard uncertainty [ns]."""
    source: str = "sync tap"
    """Source of the measurement, for example a sync tap."""

    @property
    def document(self) -> dict[str, int | str]:
        """The latency as plain data."""
        return {"latency_ns": self.latency_ns, "uncertainty_ns": self.uncertainty_ns, "source": self.source}

    @classmethod
    def from_document(cls, document: dict) -> StreamLatency:
        """Read a latency from plain data; raises KeyError or ValueError if it is damaged."""
        return cls(int(document["latency_ns"]), int(document["uncertainty_ns"]), str(document["source"]))


@dataclass(frozen=True)
class ClockModel:
    """A linear clock: sample time = reference + period (counter - first counter) - latency."""

    first_counter: int
    """Counter at the reference [frames], or the device's own time [ns], by `axis`."""
    reference_ns: int
    """Fitted host time of that frame's earliest arrival [ns]."""
    period_ns: float
    """Frame period on the host's clock [ns]; with the axis ``device_ns``: host time per device time [1]."""
    frames: int
    """Arrivals that were fitted."""
    first_arrival_ns: int = 0
    """Arrival from which this line holds [ns]."""
    delay_ns: float = 0.0
    """Mean latency beyond the minimum [ns]."""
    jitter_ns: float = 0.0
    """Standard deviation of the latency [ns]."""
    uncertainty_ns: float = 0.0
    """Distance of the smallest latency of a few seconds from the line, root mean square [ns]."""
    drift_uncertainty: float = 0.0
    """Standard uncertainty of the period that follows from it [1]."""
    axis: str = "counter"
    """Abscissa of the line: ``counter``, ``device_ns``, or ``order`` (numbered on arrival, so losses are not seen)."""
    latency: StreamLatency | None = None
    """The link's minimum latency, if it was measured."""
    earlier: tuple[ClockModel, ...] = ()
    """Lines before a restart or a step of the device's clock, oldest first."""

    @property
    def steady(self) -> bool:
        """Whether the line can be used: numbers given on arrival must fit it within half a period."""
        return self.axis != "order" or self.jitter_ns < 0.5 * self.period_ns

    def drift(self, nominal_period_ns: float) -> float:
        """Return how much slower the device runs than ``nominal_period_ns`` [ns], in ppm."""
        return (self.period_ns / (1.0 if self.axis == "device_ns" else nominal_period_ns) - 1) * 1e6

    def with_latency(self, latency: StreamLatency | None) -> ClockModel:
        """Return the model with another constant latency, on all its lines."""
        return replace(self, latency=latency, earlier=tuple(replace(line, latency=latency) for line in self.earlier))

    def sample_ns(self, counter: np.ndarray) -> np.ndarray:
        """Return sample times [ns], shape (n,), int64, on the latest line, of counters [frames], shape (n,)."""
        elapsed = np.asarray(counter, dtype=np.int64) - self.first_counter
        constant = self.latency.latency_ns if self.latency else 0
        return self.reference_ns - constant + np.rint(self.period_ns * elapsed).astype(np.int64)

    def sample_of(self, counter: int) -> int:
        """Return the estimated sample time [ns] of one counter [frames] on the latest line."""
        constant = self.latency.latency_ns if self.latency else 0
        return self.reference_ns - constant + round(self.period_ns * (counter - self.first_counter))

    def sample_times(self, arrival_ns: np.ndarray, counter: np.ndarray) -> np.ndarray:
        """Return sample times [ns], shape (n,), int64, each by the line that was valid when it arrived.

        Args:
            arrival_ns: Host times of receipt [ns], shape (n,).
            counter: Counters [frames] or device times [ns], shape (n,); where it is -1, or the
                line is not steady, the arrival less the latency is returned.
        """
        arrival_ns, counter = np.asarray(arrival_ns, np.int64), np.asarray(counter, np.int64)
        constant = self.latency.latency_ns if self.latency else 0
        if not self.steady:
            return arrival_ns - constant
        lines = (*self.earlier, self)
        begins = np.array([line.first_arrival_ns for line in lines])
        # Frames before the first line are timed by it, too.
        which = np.maximum(np.searchsorted(begins, arrival_ns, side="right") - 1, 0)
        times = np.zeros(len(counter), np.int64)
        for number, line in enumerate(lines):
            rows = which == number
            times[rows] = line.sample_ns(counter[rows])
        return np.where(counter >= 0, times, arrival_ns - constant)

    @property
    def steps_ns(self) -> tuple[int, ...]:
        """Steps of the device's clock at the beginning of each new line [ns]; positive if it fell behind."""
        lines = (*self.earlier, self)
        return tuple(
            new.sample_of(new.first_counter) - old.sample_of(new.first_counter) for old, new in pairwise(lines)
        )

    @property
    def document(self) -> dict[str, str]:
        """The model as MCAP metadata."""
        values = {
            "method": "lower envelope of arrival against counter",
            "first_counter": str(self.first_counter),
            "reference_ns": str(self.reference_ns),
            # All digits: a rounded period would move the times of a long recording.
            "period_ns": repr(self.period_ns),
            "frames": str(self.frames),
            "first_arrival_ns": str(self.first_arrival_ns),
            "delay_ns": f"{self.delay_ns:.0f}",
            "jitter_ns": f"{self.jitter_ns:.0f}",
            "uncertainty_ns": f"{self.uncertainty_ns:.0f}",
            "drift_uncertainty": f"{self.drift_uncertainty:.3g}",
            "axis": self.axis,
        }
        if self.latency is not None:
            values |= {"latency": json.dumps(self.latency.document)}
        if self.earlier:
            values |= {"earlier": json.dumps([line.document for line in self.earlier])}
        return values

    @classmethod
    def from_document(cls, document: dict[str, str]) -> ClockModel:
        """Read a model from its `document`; raises KeyError or ValueError if it is damaged."""
        latency = document.get("latency")
        return cls(
            int(document["first_counter"]),
            int(document["reference_ns"]),
            float(document["period_ns"]),
            int(document["frames"]),
            int(document.get("first_arrival_ns", 0)),
            float(document.get("delay_ns", 0)),
            float(document.get("jitter_ns", 0)),
            float(document.get("uncertainty_ns", 0)),
            float(document.get("drift_uncertainty", 0)),
            document.get("axis", "counter"),
            StreamLatency.from_document(json.loads(latency)) if latency else None,
            tuple(cls.from_document(line) for line in json.loads(document.get("earlier", "[]"))),
        )
