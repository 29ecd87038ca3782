"""Readings come late by a constant time."""

import numpy as np

from tacdata.chain.memory import delayed
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, State, Values

LONG = 0.25
"""Longest delay of a sensor [s]; longer ones are errors of clocks."""


class Latency(Effect):
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    equation = "s(t) = s_e(t - L)"
    experiment = "three rates: a delay is the same time at each, and edges keep their shape"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("L", "s", "delay", 0.05, -1.0, 2.0),)
    at_rest = AtRest.CATCHES_UP

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        delay = np.full(course.rows, float(values["L"]))
        return state.with_signal(delayed(state.signal, course.time, course.episode, delay))

    def time_constant(self, values: Values) -> float:
        return 0.0

    def delay(self, values: Values) -> float:
        return float(values["L"])

    def remark(self, values: Values) -> str:
        delay = self.delay(values)
        if abs(delay) <= LONG:
            return ""
        if delay < 0:
            return f"readings are {-delay:.2f} s early, impossible for a sensor: skin relaxing, or a clock wrong?"
        return f"readings are {delay:.2f} s late: more than a sensor is; were the clocks of path and readings one?"


class LatencyEitherWay(Latency):
    """Readings come late, by different times at the onset and at the recovery."""

    equation = "s(t) = s_e(t - L_in) while load rises, s_e(t - L_out) while it falls"
    source = "standard form; two times, as rise and fall times of a channel are given"
    experiment = "three rates: each edge has a constant delay, the same at every rate"
    form_error = 0.05
    parameters = (
        Parameter("L_in", "s", "delay while load rises", 0.05, -1.0, 2.0),
        Parameter("L_out", "s", "delay while load falls", 0.05, -1.0, 2.0),
    )

    def apply(self, state: State, values: Values) -> State:
        # The reading with more load of the two is that of the later fall. The direction of motion is not used:
        # noise of the path would reverse it.
        course, start = state.course, state.signal[:1]
        onset, recovery = (float(values[name]) for name in ("L_in", "L_out"))
        first, second = (
            delayed(state.signal, course.time, course.episode, np.full(course.rows, delay))
            for delay in (onset, recovery)
        )
        more = np.abs(second - start) > np.abs(first - start)
        return state.with_signal(np.where(more == (recovery >= onset), second, first))

    def time_constant(self, values: Values) -> float:
        return 0.0

    def delay(self, values: Values) -> float:
        return 0.5 * float(values["L_in"] + values["L_out"])

    def remark(self, values: Values) -> str:
        onset, recovery = (float(values[name]) for name in ("L_in", "L_out"))
        if max(abs(onset), abs(recovery)) <= LONG:
            return ""
        return (
            f"readings are {onset:.2f} s late while load rises and {recovery:.2f} s while it falls: their "
            "common part is a delay or a clock, the rest a slow recovery"
        )
