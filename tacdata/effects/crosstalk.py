"""Neighbours in the wiring speak to each other."""

import numpy as np

from tacdata.effects.effect import Course, Effect, Family, Parameter, Response, State, Values


class Crosstalk(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "lateral spread"
    family = Family.CROSSTALK
    memoryless = True
    equation = "s_i = s_i + k (s_{i-1} + s_{i+1}) above idle"
    experiment = "charge one channel electrically: neighbours on the wire respond, not those in place"
    parameters = (Parameter("k", "1", "share of each neighbour", 0.03, -0.4, 0.4),)
    by_channel = True

    def apply(self, state: State, values: Values) -> State:
        channels = state.signal.shape[1]
        mixed = float(values["k"]) * (np.eye(channels, k=1) + np.eye(channels, k=-1))
        signal = state.signal @ (np.eye(channels) + mixed)
        # Only changes cross over: a constant share of a neighbour's offset is part of the own offset.
        signal -= state.idle @ mixed
        return state.with_signal(signal)

    def unjudgeable(self, course: Course, response: Response) -> str:
        if course.channels < 2:
            return "one channel"
        return super().unjudgeable(course, response)


class CrosstalkEitherWay(Crosstalk):
    """Neighbours in the wiring speak to each other, one way more than the other."""

    equation = "s_i = s_i + b s_{i-1} + n s_{i+1} above idle"
    source = "charge left over from the channel that was read before"
    parameters = (
        Parameter("b", "1", "share of the channel before", 0.03, -0.4, 0.4),
        Parameter("n", "1", "share of the next channel", 0.03, -0.4, 0.4),
    )

    def apply(self, state: State, values: Values) -> State:
        rise = state.rise
        more = np.zeros_like(rise)
        # The outermost channels have one neighbour.
        more[:, 1:] += values["b"] * rise[:, :-1]
        more[:, :-1] += values["n"] * rise[:, 1:]
        return state.with_signal(state.signal + more)
