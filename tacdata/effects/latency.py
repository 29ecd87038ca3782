"""Readings come late by a constant time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import delayed
from tacdata.effects.effect import AtRest, Effect, Family, Parameter

LONG = 0.25
"""A longer delay is of clocks, not of sensors [s]."""


class Latency(Effect):
    """Readings come late by a constant time."""

    title = "Readings come late by a constant time"
    catalogue = ("D1",)
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "delay"
    equation = "s(t) = s_e(t - L)"
    source = "standard form"
    experiment = "three rates: a delay is the same time at each, and edges keep their shape"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("L", "s", "delay", 0.05, -1.0, 2.0),)
    at_rest = AtRest.CATCHES_UP

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        late = np.full(course.rows, float(values["L"]))
        return replace(state, signal=delayed(state.signal, course.time, course.episode, late))

    def time_constant(self, values: dict[str, np.ndarray]) -> float:
        """Return 0: a delay has no time constant."""
        return 0.0

    def delay(self, values: dict[str, np.ndarray]) -> float:
        """Return by how much readings come late [s]."""
        return float(values["L"])

    def remark(self, values: dict[str, np.ndarray]) -> str:
        """Return what a long delay says of the clocks."""
        late = self.delay(values)
        if abs(late) <= LONG:
            return ""
        if late < 0:
            return f"readings come {-late:.2f} s early, as no sensor does: does the skin relax, or were clocks not one?"
        return f"readings are {late:.2f} s late: more than a sensor is; were the clocks of path and readings one?"
