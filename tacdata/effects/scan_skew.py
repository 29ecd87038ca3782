"""Channels are read one after the other."""

import numpy as np

from tacdata.chain.memory import delayed
from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class ScanSkew(Effect):
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    equation = "s_i(t) = s_i(t - i D / (channels - 1))"
    experiment = "fast presses over several channels: the delay is linear in the channel's number"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("D", "s", "from the first channel to the last", 0.03, -0.5, 0.5),)
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        count = course.channels
        signal = state.signal.copy()
        # About the middle channel: a delay common to all is another effect, `latency`.
        for i in range(count):
            delay = np.full(course.rows, values["D"] * (i / (count - 1) - 0.5))
            signal[:, i] = delayed(state.signal[:, [i]], course.time, course.episode, delay)[:, 0]
        return state.with_signal(signal)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "one channel" if course.channels < 2 else ""
