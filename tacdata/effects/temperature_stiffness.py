"""Warmth stiffens the skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class TemperatureStiffness(Effect):
    """Warmth stiffens the skin."""

    title = "Warmth stiffens the skin"
    catalogue = ("M12",)
    stage = "mechanics"
    moves = ("signal", "force")
    group = "temperature"
    family = Family.DRIFT
    equation = "q = q_e (1 + k (T - T_mean) / 10)"
    source = "entropic elasticity, G ~ T; Treloar, The Physics of Rubber Elasticity"
    experiment = "readings without contact at several temperatures: they move by electronics, pressed ones by both"
    parameters = (Parameter("k", "1/10K", "relative change over 10 K", 0.03, -0.5, 0.5),)

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        given = np.zeros(state.course.rows) if state.course.temperature is None else state.course.temperature
        warm = np.nan_to_num((given - np.nanmean(given)) / 10.0)
        more = 1 + values["k"] * warm
        return replace(state, load=state.load * more[:, None], force=state.force * more)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        if course.temperature is None:
            return "no temperature was recorded"
        return "the temperature hardly changed" if np.nanstd(course.temperature) < 0.2 else ""
