"""The readings' clock runs fast or slow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import delayed
from tacdata.effects.effect import Effect, Family, Parameter


class ClockSkew(Effect):
    """The readings' clock runs fast or slow."""

    title = "The readings' clock runs fast or slow"
    catalogue = ("D2",)
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    equation = "s(t) = s_e(t - r (t - T/2))"
    source = "standard form"
    experiment = "a sync event early in the recording, and one late"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("r", "s", "delay gained over all recordings", 0.1, -5.0, 5.0),)
    follows_clock = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        late = float(values["r"]) * (course.time / max(float(course.time[-1]), 1e-9) - 0.5)
        return replace(state, signal=delayed(state.signal, course.time, course.episode, late))

    def remark(self, values: dict[str, np.ndarray]) -> str:
        """Return what a skew says of the clocks."""
        return "the clocks of path and readings run apart: record both on one clock, or a tap early and late"
