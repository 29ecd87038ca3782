"""Readings move with temperature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class TemperatureOffset(Effect):
    """Readings move with temperature."""

    title = "Readings move with temperature"
    catalogue = ("T19", "E1")
    stage = "readout"
    moves = ("signal",)
    group = "temperature"
    family = Family.DRIFT
    equation = "s_i = s_i + k_i (T - T_mean) / 10"
    source = "standard form"
    experiment = "readings without contact at several temperatures"
    parameters = (
        Parameter("k", "largest rise/10K", "change of the channel over 10 K", 0.02, -5.0, 5.0, per_channel=True),
    )
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        scale = state.response.largest(state.signal)
        given = np.zeros(state.course.rows) if state.course.temperature is None else state.course.temperature
        warm = np.nan_to_num((given - np.nanmean(given)) / 10.0)
        return replace(state, signal=state.signal + scale * warm[:, None] * values["k"])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        if course.temperature is None:
            return "no temperature was recorded"
        return "the temperature hardly changed" if np.nanstd(course.temperature) < 0.2 else ""
