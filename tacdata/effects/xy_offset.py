"""Lateral error of registration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.effects.effect import Effect, Family, Parameter


class XyOffset(Effect):
    """Lateral error of registration."""

    title = "Lateral error of registration"
    catalogue = ("K1", "G6")
    stage = "kinematics"
    moves = ("label", "signal")
    group = "lateral"
    family = Family.KINEMATICS
    word = "offset in x and y"
    equation = "(x, y) -> (x + dx, y + dy)"
    source = "standard form"
    experiment = (
        "a cross of presses around one taxel from opposite sides; optical touch-off of the skin's edges tells "
        "a shifted skin from a shifted frame"
    )
    form_error = 0.02
    parameters = (
        Parameter("dx", "mm", "shift along x", 0.1, -2.0, 2.0),
        Parameter("dy", "mm", "shift along y", 0.1, -2.0, 2.0),
    )
    each_episode = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        shift = np.stack([values["dx"], values["dy"], np.zeros(())], axis=-1)
        return replace(state, pose=state.pose + shift)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "a fitted response takes up whatever has no memory" if response.fitted else ""
