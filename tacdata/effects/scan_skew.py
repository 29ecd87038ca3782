"""Channels are read one after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import delayed
from tacdata.effects.effect import Effect, Family, Parameter


class ScanSkew(Effect):
    """Channels are read one after the other."""

    title = "Channels are read one after the other"
    catalogue = ("T17",)
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    equation = "s_i(t) = s_i(t - i D / (channels - 1))"
    source = "standard form"
    experiment = "fast presses over several channels: the delay is linear in the channel's number"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("D", "s", "from the first channel to the last", 0.03, -0.5, 0.5),)
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        course = state.course
        count = course.channels
        signal = state.signal.copy()
        for i in range(count):
            late = np.full(course.rows, values["D"] * (i / (count - 1) - 0.5))
            signal[:, i] = delayed(state.signal[:, [i]], course.time, course.episode, late)[:, 0]
        return replace(state, signal=signal)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "one channel" if course.channels < 2 else ""
