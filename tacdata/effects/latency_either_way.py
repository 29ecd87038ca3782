"""Readings come late, by one time while load rises and by another while it falls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import delayed
from tacdata.effects.effect import AtRest, Effect, Family, Parameter, Placed
from tacdata.effects.latency import LONG, Latency


class LatencyEitherWay(Effect):
    """Readings come late, by one time while load rises and by another while it falls."""

    title = "Readings come late, by one time at the onset and by another at the recovery"
    catalogue = ("D1",)
    stage = "timing"
    moves = ("signal",)
    group = "lag"
    family = Family.DELAY_AND_FILTER
    word = "delay"
    equation = "s(t) = s_e(t - L_in) while load rises, s_e(t - L_out) while it falls"
    source = "standard form; two times, as rise and fall times of a channel are given"
    experiment = "three rates: each edge is late by its own time, the same at every rate"
    mechanism = "latency"
    form_error = 0.05
    distributed = False
    parameters = (
        Parameter("L_in", "s", "delay while load rises", 0.05, -1.0, 2.0),
        Parameter("L_out", "s", "delay while load falls", 0.05, -1.0, 2.0),
    )
    at_rest = AtRest.CATCHES_UP

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it.

        Of the two delayed readings the one with more load is that of the later fall. So no direction is asked for,
        which noise of the path would turn about.
        """
        course, rest = state.course, state.signal[:1]
        onset, recovery = (float(values[name]) for name in ("L_in", "L_out"))
        first, second = (
            delayed(state.signal, course.time, course.episode, np.full(course.rows, late)) for late in (onset, recovery)
        )
        more = np.abs(second - rest) > np.abs(first - rest)
        return replace(state, signal=np.where(more == (recovery >= onset), second, first))

    def time_constant(self, values: dict[str, np.ndarray]) -> float:
        """Return 0: a delay has no time constant."""
        return 0.0

    def delay(self, values: dict[str, np.ndarray]) -> float:
        """Return by how much readings come late, in the mean of both ways [s]."""
        return 0.5 * float(values["L_in"] + values["L_out"])

    def nested(self, values: dict[str, np.ndarray]) -> Placed:
        """Return one delay for both ways."""
        return Placed(Latency(), {"L": np.asarray(self.delay(values))})

    def remark(self, values: dict[str, np.ndarray]) -> str:
        """Return what long delays say of the clocks, or of what holds the load."""
        onset, recovery = (float(values[name]) for name in ("L_in", "L_out"))
        if max(abs(onset), abs(recovery)) <= LONG:
            return ""
        return (
            f"readings are {onset:.2f} s late while load rises and {recovery:.2f} s while it falls: what both share is "
            "a delay or a clock, the rest a slow recovery"
        )
