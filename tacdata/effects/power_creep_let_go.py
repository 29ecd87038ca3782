"""Stress relaxation over many decades, of a skin that the tool can leave."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.contact import let_go
from tacdata.effects.power_creep import PowerCreep


class PowerCreepLetGo(PowerCreep):
    """Stress relaxation over many decades, of a skin that the tool can leave."""

    title = "Stress relaxation over many decades, of a skin that the tool can leave"
    equation = "q = q_e - f mean of L_tau q_e over six times in steps of 3, 0 where the force would pull"
    source = "broad spectrum; Ferry, ch. 4; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        return let_go(super().apply(state, values))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "loads are not known: read by a transducer of any power" if response.fitted else ""
