"""Readings move with temperature."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


def same_temperature(self: Effect, course: Course, response: Response) -> str:
    """Return the reason why recordings do not show an effect of temperature; empty if they may."""
    if course.temperature is None:
        return "no temperature was recorded"
    return "the temperature hardly changed" if np.nanstd(course.temperature) < 0.2 else ""


class TemperatureOffset(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "temperature"
    family = Family.DRIFT
    equation = "s_i = s_i + k_i (T - T_mean) / 10"
    experiment = "readings without contact at several temperatures"
    parameters = (
        Parameter("k", "largest rise/10K", "change of the channel over 10 K", 0.02, -5.0, 5.0, per_channel=True),
    )
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        scale = state.response.largest(state.signal)
        # About the mean temperature: a constant part is an offset.
        return state.with_signal(state.signal + scale * state.course.warmth[:, None] * values["k"])

    unjudgeable = same_temperature
