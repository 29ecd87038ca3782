"""All channels read too much or too little."""

from tacdata.effects.effect import Effect, Family, GainKind, Parameter, State, Values


class Gain(Effect):
    stage = "taxel"
    moves = ("signal",)
    group = "amplitude"
    family = Family.RESPONSE_CURVE
    memoryless = True
    equation = "s = (1 + e) s above idle"
    experiment = "a reference capacitor in a taxel's place, or a force sensor: whether readings are off, or the skin"
    form_error = 0.02
    parameters = (Parameter("e", "1", "relative excess", 0.1, -0.9, 3.0),)
    gain = GainKind.COMMON

    def apply(self, state: State, values: Values) -> State:
        return state.with_rise(state.rise * (1 + values["e"]))
