"""Channels have gains of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, GainKind, Parameter


class ChannelGain(Effect):
    """Channels have gains of their own."""

    title = "Channels have gains of their own"
    catalogue = ("T3",)
    stage = "taxel"
    moves = ("signal",)
    group = "per channel"
    family = Family.RESPONSE_CURVE
    equation = "s_i = (1 + e_i) s_i above idle"
    source = "standard form"
    experiment = "press all channels alike, or between taxels: a gain goes with the channel, uneven skin with the place"
    form_error = 0.02
    parameters = (Parameter("e", "1", "relative excess of the channel", 0.1, -0.95, 3.0, per_channel=True),)
    gain = GainKind.PER_CHANNEL
    by_channel = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        return replace(state, signal=idle + (state.signal - idle) * (1 + values["e"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
