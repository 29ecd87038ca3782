"""The readings' clock runs fast or slow."""

from tacdata.chain.memory import delayed
from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class ClockSkew(Effect):
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    equation = "s(t) = s_e(t - r (t - T/2))"
    experiment = "a sync event early in the recording, and one late"
    form_error = 0.02
    distributed = False
    parameters = (Parameter("r", "s", "delay gained over all recordings", 0.1, -5.0, 5.0),)
    follows_clock = True

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        delay = float(values["r"]) * (course.clock - 0.5)
        return state.with_signal(delayed(state.signal, course.time, course.episode, delay))

    def remark(self, values: Values) -> str:
        return "the clocks of path and readings run apart: record both on one clock, or a tap early and late"
