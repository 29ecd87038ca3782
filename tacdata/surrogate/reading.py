"""Maps loads of protrusions to one number per channel, and that to readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.sensor import Sensor
from tacdata.transduction import Loads, Transducer

POINTS = 400
"""Points of the curve."""
_NOTHING = 1e-9
"""Share of the largest derivative below which a derivative counts as zero."""


@dataclass(frozen=True)
class ReadingCurve:
    """The curve from a table's loads to readings."""

    by: str
    """Kind of load: "force" [N], "closure" [mm] or "capacitance" [pF], whichever alone determines a reading."""
    curve_load: np.ndarray
    """Loads [as above], shape (m,), increasing."""
    curve_signal: np.ndarray
    """Change of capacitance at those loads [pF], shape (m,)."""
    gain: np.ndarray
    """[counts/pF], shape (taxels,)."""
    offset: np.ndarray
    """Reading without load [counts], shape (taxels,)."""

    def load(self, loads: Loads, transducer: Transducer) -> np.ndarray:
        """Return the one number that determines a reading, shape (n, taxels)."""
        if self.by == "capacitance":
            return transducer.principle.capacitance(loads) - transducer.rest
        return np.asarray(getattr(loads, self.by))


def reading_of(sensor: Sensor, loads: Loads) -> ReadingCurve:
    """Return the curve from such loads to readings, by the sensor's transduction.

    If the force alone, or the closure alone, determines a reading by one curve for all taxels, it is the load; effects
    of the skin act on it. Otherwise the load is the change of capacitance.

    Args:
        sensor: The sensor.
        loads: Loads of typical states, shapes (n, taxels).
    """
    transducer = Transducer.of(sensor)
    slopes = transducer.derivatives(loads)
    # Derivative times load is a change of capacitance, so that the three kinds compare.
    weight = {name: float(np.abs(getattr(slopes, name) * load).max()) for name, load in vars(loads).items()}
    dominant = [name for name, value in weight.items() if value > _NOTHING * max(weight.values())]
    # A parameter that differs from taxel to taxel leaves no common curve.
    numbers = [np.ptp(np.atleast_1d(v)) for v in vars(transducer.principle).values()]
    alone = len(dominant) == 1 and dominant[0] in ("force", "closure") and not any(numbers)
    by = dominant[0] if alone else "capacitance"
    if by == "capacitance":
        top = float(np.abs(transducer.principle.capacitance(loads) - transducer.rest).max())
        at = np.array([0.0, max(top, 1e-9)])
        # The identity: this load already is the change of capacitance.
        return ReadingCurve(by, at, at, transducer.gain, transducer.offset)
    at = np.linspace(0.0, 1.5 * float(getattr(loads, by).max()), POINTS)
    none = np.zeros((POINTS, transducer.taxels))
    arrays = {"force": none, "closure": none, "area": none, by: np.repeat(at[:, None], transducer.taxels, axis=1)}
    change = transducer.principle.capacitance(Loads(**arrays)) - transducer.rest
    # All taxels have the same curve here, so that the first stands for them.
    return ReadingCurve(by, at, change[:, 0], transducer.gain, transducer.offset)
