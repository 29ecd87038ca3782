"""Gain drifts with the clock, that of readings without contact, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.at_rest import told_at_rest
from tacdata.effects.effect import Effect, Family, Parameter


class GainDriftWhole(Effect):
    """Gain drifts with the clock, that of readings without contact, too."""

    title = "Gain drifts with the clock, that of readings without contact, too"
    catalogue = ("T25", "E1")
    stage = "readout"
    moves = ("signal",)
    group = "clock"
    family = Family.DRIFT
    equation = "s = s (1 + k (1 - exp(-t / tau))), s with its value without contact: a magnet's field, a supply"
    source = "first-order approach to the temperature at work"
    experiment = "readings without contact from power-on: all change by one factor"
    parameters = (
        Parameter("k", "1", "relative change in the end", 0.05, -1.5, 1.5),
        Parameter("tau", "s", "time constant", 600.0, 20.0, 100000.0, grid=(200.0, 600.0, 2000.0)),
    )
    follows_clock = True
    mechanism = "gain_drift"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        more = -np.expm1(-state.course.time / values["tau"])
        return replace(state, signal=state.signal * (1 + values["k"] * (more - more.mean()))[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return told_at_rest(course)[1]
