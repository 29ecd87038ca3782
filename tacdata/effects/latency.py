"""Readings come late by a constant time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import delayed
from tacdata.effects.effect import Effect, Parameter


class Latency(Effect):
    """Readings come late by a constant time."""

    title = "Readings come late by a constant time"
    catalogue = ("D1",)
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    equation = "s(t) = s_e(t - L)"
    source = "standard form"
    experiment = "three rates: constant in time, and edges keep their shape"
    form_error = 0.02
    parameters = (Parameter("L", "s", "delay", 0.05, -1.0, 2.0),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        late = np.full(course.rows, float(values["L"]))
        return replace(state, signal=delayed(state.signal, course.time, course.episode, late))
