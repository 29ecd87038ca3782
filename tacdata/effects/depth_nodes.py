"""The simulation is interpolated between solved depths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter

CLOSE = 0.2
"""Smooth curves through depths that stand closer, over the deepest press, follow any contact [1]."""


class DepthNodes(Effect):
    """The simulation is interpolated between solved depths."""

    title = "The simulation is interpolated between solved depths"
    catalogue = ("S4",)
    stage = "simulator"
    moves = ("label", "signal")
    group = "simulator"
    family = Family.SIMULATION
    form_error = 0.02
    equation = "s = s + s sin(2 pi d / p) a sin-cos pair, p the spacing of solved depths"
    source = "standard form"
    experiment = "solve between the nodes: no recording is needed"
    parameters = (
        Parameter("s", "1", "sine part", 0.02, -0.5, 0.5),
        Parameter("c", "1", "cosine part", 0.02, -0.5, 0.5),
        Parameter("p", "mm", "spacing", 0.25, 0.05, 1.0, grid=(0.1, 0.25, 0.5)),
    )

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        idle = state.response.signal(np.zeros_like(state.load[:1]))
        angle = 2 * np.pi * np.maximum(state.depth, 0.0) / values["p"]
        wave = values["s"] * np.sin(angle) + values["c"] * (np.cos(angle) - 1)
        return replace(state, signal=state.signal + (state.signal - idle) * wave[:, None])

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        apart = response.spacing
        if apart is not None and apart < CLOSE * course.span:
            return f"depths were solved {apart:.2g} mm apart or closer: what is read between them is off by far less"
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
