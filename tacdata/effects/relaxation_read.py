"""Stress relaxation, one exponential, of a skin that the tool can leave, read by a transducer of any power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import low_pass
from tacdata.effects.effect import Parameter
from tacdata.effects.relaxation import Relaxation

POWER = Parameter("m", "1", "power of load by which readings grow", 1.0, 0.3, 4.0, grid=(0.67, 1.0, 1.5))
"""Of the transducer: 2/3 where a protrusion closes a gap as Hertz says, above 1 where a gap nears its end."""


class RelaxationRead(Relaxation):
    """Stress relaxation, one exponential, of a skin that the tool can leave, read by a transducer of any power."""

    title = "Stress relaxation, one exponential, of a skin that the tool can leave, read by a transducer of any power"
    equation = "r = max(0, F - f L_tau F)^m, F = r_e^(1/m), of each channel"
    source = "standard linear solid; unilateral contact: Johnson, Contact Mechanics, ch. 6.5"
    parameters = (
        Parameter("f", "1", "relaxed share of load", 0.1, 0.0, 0.95),
        Parameter("tau", "s", "time constant", 2.0, 0.05, 500.0, grid=(0.4, 2.5, 16.0, 60.0)),
        POWER,
    )
    mechanism = "relaxation"
    times_by_radius = None  # of loads that are not known

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        both, power = np.column_stack([state.load, state.force]), float(values["m"])
        most = np.abs(both).max(axis=0)
        # Loads push: a channel's sign is that of its largest reading.
        largest = both[np.abs(both).argmax(axis=0), np.arange(both.shape[1])]
        scale = np.where(most > 0, np.copysign(most, largest), 1.0)
        share = both / scale
        load = np.copysign(np.abs(share) ** (1 / power), share)
        left = load - values["f"] * self.late(load, state.course.step, values)
        left = np.where(load > 0, np.maximum(left, 0.0) ** power, share)
        return replace(state, load=(left * scale)[:, :-1], force=(left * scale)[:, -1])

    def late(self, load: np.ndarray, step: np.ndarray, values: dict[str, np.ndarray]) -> np.ndarray:
        """Return the mean of the loads so far that relaxes, of the same shape."""
        return low_pass(load, step, float(values["tau"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return super().unjudgeable(course, response) if response.fitted else "loads are known, whatever reads them"
