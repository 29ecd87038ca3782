"""Neighbours in the wiring speak to each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class Crosstalk(Effect):
    """Neighbours in the wiring speak to each other."""

    title = "Neighbours in the wiring speak to each other"
    catalogue = ("T10",)
    stage = "readout"
    moves = ("signal",)
    group = "lateral spread"
    family = Family.CROSSTALK
    equation = "s_i = s_i + k (s_{i-1} + s_{i+1}) above idle"
    source = "standard form"
    experiment = "charge one channel electrically: neighbours on the wire answer, not those in place"
    parameters = (Parameter("k", "1", "share of each neighbour", 0.03, -0.4, 0.4),)
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        channels = state.signal.shape[1]
        mixed = float(values["k"]) * (np.eye(channels, k=1) + np.eye(channels, k=-1))
        signal = state.signal @ (np.eye(channels) + mixed)
        signal -= idle @ mixed
        return replace(state, signal=signal)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        if course.channels < 2:
            return "one channel"
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
