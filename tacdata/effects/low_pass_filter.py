"""Low-pass filter of first order in the readout."""

from tacdata.chain.memory import low_pass_between
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, State, Values


class LowPassFilter(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "low-pass filter"
    equation = "tau s' + s = s_e"
    experiment = "edges: a filter rounds them, a delay keeps their shape; spectrum of noise without contact"
    parameters = (Parameter("tau", "s", "time constant", 0.05, 0.0, 2.0),)
    at_rest = AtRest.CATCHES_UP

    def apply(self, state: State, values: Values) -> State:
        tau = float(values["tau"])
        if tau <= 0.0:
            return state
        # The filter has settled before the first row, whatever is read there.
        start = state.signal[:1]
        return state.with_signal(start + low_pass_between(state.signal - start, state.course.step, tau))
