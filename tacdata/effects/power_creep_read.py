"""Stress relaxation over many decades, of a skin that the tool can leave, read by a transducer of any power."""

from __future__ import annotations

import numpy as np

from tacdata.chain.memory import low_passes
from tacdata.effects.power_creep import PowerCreep
from tacdata.effects.relaxation_read import POWER, RelaxationRead


class PowerCreepRead(RelaxationRead):
    """Stress relaxation over many decades, of a skin that the tool can leave, read by a transducer of any power."""

    title = "Stress relaxation over many decades, of a skin that the tool can leave, read by a transducer of any power"
    equation = "r = max(0, F - f mean of L_tau F over six times in steps of 3)^m, F = r_e^(1/m), of each channel"
    source = "broad spectrum; Ferry, ch. 4; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"
    parameters = (*PowerCreep.parameters, POWER)

    def late(self, load: np.ndarray, step: np.ndarray, values: dict[str, np.ndarray]) -> np.ndarray:
        """Return the mean of the loads so far that relaxes, of the same shape."""
        return low_passes(load, step, float(values["tau0"]) * 3.0 ** np.arange(6), np.full(6, 1 / 6))
