"""Channels have different gains."""

from tacdata.effects.effect import Effect, Family, GainKind, Parameter, State, Values


class ChannelGain(Effect):
    stage = "taxel"
    moves = ("signal",)
    group = "per channel"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "s_i = (1 + e_i) s_i above idle"
    experiment = "press every channel, or between taxels: a gain belongs to the channel, uneven skin to the place"
    form_error = 0.02
    parameters = (Parameter("e", "1", "relative excess of the channel", 0.1, -0.95, 3.0, per_channel=True),)
    gain = GainKind.PER_CHANNEL
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        # Above idle alone: calibration takes the offset off before a gain counts.
        return state.with_rise(state.rise * (1 + values["e"]))
