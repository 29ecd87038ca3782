"""Readings drift with the clock."""

from tacdata.effects.effect import Effect, Family, Parameter, State, Values


class Drift(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s_i = s_i + r_i t / T, T the length of the recordings"
    experiment = "readings without contact, through the whole session"
    parameters = (
        Parameter("r", "largest rise", "drift of the channel over all recordings", 0.02, -5.0, 5.0, per_channel=True),
    )
    follows_clock = True
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        # About the middle of the recordings: a drift from their start would resemble an offset.
        scale = state.response.largest(state.signal)
        return state.with_signal(state.signal + scale * (state.course.clock - 0.5)[:, None] * values["r"])
