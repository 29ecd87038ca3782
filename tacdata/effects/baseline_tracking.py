"""The chip pulls every reading back to its baseline."""

from tacdata.chain.memory import low_pass
from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class BaselineTracking(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "hold time"
    family = Family.DELAY_AND_FILTER
    equation = "b' = r (s - b), read s - b above idle: long presses decay to zero and undershoot on release"
    source = "NXP AN3891, baseline system of the MPR121"
    experiment = "switch it off; hold long: the plateau is zero, and the loss comes back negative after release"
    parameters = (Parameter("r", "1/s", "rate", 0.01, 0.0, 3.0),)

    def apply(self, state: State, values: Values) -> State:
        rate = float(values["r"])
        if rate <= 0.0:
            return state
        rise = state.rise
        # A baseline that follows at rate r is the first-order mean of the rise; what is read is the rest.
        return state.with_signal(state.idle + rise - low_pass(rise, state.course.step, 1 / rate))

    def time_constant(self, values: Values) -> float:
        """Return the time constant, one over its rate [s]."""
        rate = float(values["r"])
        return 1 / rate if rate > 0 else 0.0
