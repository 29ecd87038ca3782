"""Stress relaxation, one exponential, of a skin that the tool can leave."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.contact import let_go
from tacdata.effects.relaxation import Relaxation


class RelaxationLetGo(Relaxation):
    """Stress relaxation, one exponential, of a skin that the tool can leave."""

    title = "Stress relaxation, one exponential, of a skin that the tool can leave"
    equation = "q = q_e - f L_tau q_e where that force pushes, 0 where it would pull"
    source = "standard linear solid; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"
    mechanism = "relaxation"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        return let_go(super().apply(state, values))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        few = super().unjudgeable(course, response)
        return few or ("loads are not known: read by a transducer of any power" if response.fitted else "")
