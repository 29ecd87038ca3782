"""Gain drifts with the clock."""

import numpy as np

from tacdata.chain.at_rest import told_at_rest
from tacdata.effects.effect import Course, Effect, Family, Growth, Parameter, Response, State, Values


class GainDrift(Effect):
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s (1 + k (t / T - 1/2)) above idle"
    experiment = "the same press all through the session; a reference capacitor separates electronics from skin"
    parameters = (Parameter("k", "1", "relative change over all recordings", 0.05, -1.5, 1.5),)
    follows_clock = True
    grows_with = Growth.TIME

    def apply(self, state: State, values: Values) -> State:
        # About the middle of the recordings: from their start it would resemble a gain.
        return state.with_rise(state.rise * (1 + values["k"] * (state.course.clock - 0.5))[:, None])


class SettlingGain(GainDrift):
    """Gain settles after power-on."""

    equation = "s = s (1 + k exp(-t / tau)) above idle"
    source = "first-order approach to the temperature at work"
    parameters = (
        Parameter("k", "1", "relative change since the first recording", 0.05, -1.5, 1.5),
        Parameter("tau", "s", "time constant", 600.0, 20.0, 20000.0, grid=(200.0, 1500.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        more = values["k"] * np.exp(-state.course.time / values["tau"])
        return state.with_rise(state.rise * (1 + more)[:, None])


class GainDriftWhole(GainDrift):
    """Gain drifts with the clock, that of readings without contact, too."""

    grows_with = None

    equation = "s = s (1 + k (1 - exp(-t / tau))), s with its value without contact: a magnet's field, a supply"
    source = "first-order approach to the temperature at work"
    experiment = "readings without contact from power-on: all change by one factor"
    parameters = (
        Parameter("k", "1", "relative change in the end", 0.05, -1.5, 1.5),
        Parameter("tau", "s", "time constant", 600.0, 20.0, 100000.0, grid=(200.0, 600.0, 2000.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        more = -np.expm1(-state.course.time / values["tau"])
        # Less its mean, as a constant factor is a gain.
        return state.with_signal(state.signal * (1 + values["k"] * (more - more.mean()))[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        return told_at_rest(course)[1]
