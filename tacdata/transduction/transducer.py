"""The taxels of a sensor: from loads to capacitance and counts, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from tacdata import registry
from tacdata.errors import FormatError
from tacdata.sensor import Sensor
from tacdata.transduction.loads import Loads
from tacdata.transduction.principles.principle import BASE, ROOM, Principle


@dataclass(frozen=True)
class TaxelReadings:
    """Predicted readings of n states."""

    capacitance: np.ndarray
    """Capacitance [pF], shape (n, taxels)."""
    counts: np.ndarray
    """Reading [counts], shape (n, taxels), neither rounded nor noisy, clipped to 0 and full scale."""
    saturated: np.ndarray
    """Where a larger load no longer changes the reading (crushed, plates met, clipped), shape (n, taxels), bool."""
    remarks: tuple[str, ...]
    """One sentence for each taxel that saturates, with the reason."""


@dataclass(frozen=True)
class Transducer:
    """A sensor's taxels: principle, gain, offset and range.

    counts = offset + gain (C - C without load).

    Example:
        >>> import numpy as np
        >>> from tacdata.sensor import default_sensor
        >>> from tacdata.transduction import Loads, Transducer
        >>> transducer = Transducer.of(default_sensor())
        >>> force = np.zeros((1, 24))
        >>> force[0, 10] = 0.1  # N on one protrusion
        >>> readings = transducer.read(Loads(force, 0.5 * force, 0 * force))
        >>> int((readings.counts[0] - transducer.offset).argmax())
        10
    """

    principle: Principle
    """How loads change a capacitance."""
    gain: np.ndarray
    """Counts per change of capacitance [counts/pF], shape (taxels,)."""
    offset: np.ndarray
    """Reading without load [counts], shape (taxels,)."""
    full_scale: float | None = None
    """Largest reading [counts]; None for no limit."""

    @classmethod
    def of(cls, sensor: Sensor) -> Self:
        """Return the transducer that a sensor's file describes.

        Raises:
            FormatError: If the file describes none, or has parameters that the principle refuses.
            UsageError: If no such principle is known.
        """
        transduction = sensor.transduction
        if transduction is None:
            raise FormatError(
                f"sensor {sensor.name}: it has no section transduction",
                f"transduction: {{principle: {' | '.join(registry.names(ROOM, BASE))}}}",
                "add the section to the sensor file, as in tacdata/sensor/tacprint.yaml",
            )
        kind: type[Principle] = registry.load(ROOM, BASE, transduction.principle, Principle)
        count = sensor.taxels.count
        gain, offset = (
            np.broadcast_to(np.array(v, dtype=float), (count,)) for v in (transduction.gain, transduction.offset)
        )
        return cls(kind.from_numbers(transduction.parameters), gain, offset, transduction.full_scale)

    @property
    def taxels(self) -> int:
        """Number of taxels."""
        return len(self.gain)

    @property
    def rest(self) -> np.ndarray:
        """Capacitance without load [pF], shape (taxels,)."""
        return self.principle.capacitance(self._no_loads())[0]

    def read(self, loads: Loads) -> TaxelReadings:
        """Return the readings of n states.

        Raises:
            FormatError: If the loads are not finite or not of shape (n, taxels).
        """
        loads.check(self.taxels)
        capacitance = self.principle.capacitance(loads)
        counts = self.offset + self.gain * (capacitance - self.rest)
        end = self.principle.saturated(loads)
        low, high = self._clipped(counts)
        remarks = (
            *self._remarks(end, "gap closed: the reading no longer follows the load"),
            *self._remarks(high, f"reading beyond the full scale of {self.full_scale} counts"),
            *self._remarks(low, "reading below 0 counts"),
        )
        counts = counts if self.full_scale is None else np.clip(counts, 0.0, self.full_scale)
        return TaxelReadings(capacitance, counts, end | low | high, remarks)

    def derivatives(self, loads: Loads) -> Loads:
        """Return the derivatives of counts by force [1/N], closure [1/mm] and area [1/mm^2]; 0 where they are clipped.

        Raises:
            FormatError: If the loads are not finite or not of shape (n, taxels).
        """
        loads.check(self.taxels)
        slopes = self.principle.derivatives(loads)
        low, high = self._clipped(self.offset + self.gain * (self.principle.capacitance(loads) - self.rest))
        factor = np.where(low | high, 0.0, self.gain)
        return Loads(factor * slopes.force, factor * slopes.closure, factor * slopes.area)

    def loads(self, counts: np.ndarray, area: np.ndarray | None = None) -> Loads:
        """Return the loads for readings, NaN where a reading is not invertible.

        Args:
            counts: Readings [counts], shape (n, taxels).
            area: Contact areas [mm^2], same shape, for principles that need them; without them, no contact.

        Raises:
            FormatError: If the counts have another shape, or a gain is 0.
        """
        counts = np.asarray(counts, dtype=float)
        if counts.ndim != 2 or counts.shape[1] != self.taxels:
            raise FormatError(
                f"readings of shape {counts.shape}",
                f"(n, {self.taxels})",
                "give one row per frame, one column per taxel",
            )
        if not self.gain.all():
            remedy = "a dead taxel has no inverse: leave it out"
            raise FormatError("a gain of 0 counts/pF", "gains other than 0", remedy)
        capacitance = self.rest + (counts - self.offset) / self.gain
        loads = self.principle.inverse(capacitance, np.zeros_like(counts) if area is None else area)
        # A reading at the end of its range may stand for any larger load.
        low, high = self._clipped(counts, ends=True)
        return Loads(*(np.where(low | high, np.nan, v) for v in (loads.force, loads.closure, loads.area)))

    def _no_loads(self) -> Loads:
        none = np.zeros((1, self.taxels))
        return Loads(none, none, none)

    def _clipped(self, counts: np.ndarray, ends: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return where counts exceed the low and the high end of the range; with ``ends``, also where they reach it."""
        if self.full_scale is None:
            return np.zeros(counts.shape, dtype=bool), np.zeros(counts.shape, dtype=bool)
        return (counts <= 0, counts >= self.full_scale) if ends else (counts < 0, counts > self.full_scale)

    @staticmethod
    def _remarks(where: np.ndarray, why: str) -> list[str]:
        return [
            f"taxel {k}: {why}, in {where[:, k].sum()} of {len(where)} states from state {where[:, k].argmax()}"
            for k in np.flatnonzero(where.any(axis=0))
        ]
