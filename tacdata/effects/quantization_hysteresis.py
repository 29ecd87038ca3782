"""Dead band of the readings: they change only in steps, late both ways."""

from tacdata.chain.memory import play
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, State, Values


class QuantizationHysteresis(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    word = "dead band of the readings"
    equation = "s = play_w(s) + w: the reading follows through a dead band of fixed width in counts"
    source = "play operator; comparators with hysteresis"
    experiment = "slow loops of several sizes: all are as wide, in counts"
    parameters = (Parameter("w", "largest rise", "half the dead band", 0.02, 0.0, 0.3),)
    at_rest = AtRest.STAYS

    def apply(self, state: State, values: Values) -> State:
        width, largest = float(values["w"]), state.response.largest(state.signal)
        if width <= 0.0 or not largest.all():
            return state
        # Half the band is added: rising readings stay, falling ones come late.
        return state.with_signal(largest * (play(state.signal / largest, width) + width))
