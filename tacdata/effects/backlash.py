"""Play of the depth drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import State
from tacdata.chain.memory import play
from tacdata.effects.effect import Effect, Parameter

STILL = 4.0
"""A position that moves by less is still, in standard deviations of its noise [1]."""


class Backlash(Effect):
    """Play of the depth drive."""

    title = "Play of the depth drive"
    catalogue = ("K7",)
    stage = "kinematics"
    moves = ("tag", "label", "signal", "force")
    group = "loading and unloading"
    equation = "d = play_{b/2}(z) + b/2: after reversal nothing moves for b"
    source = "play operator; Brokate & Sprekels, Hysteresis and Phase Transitions, ch. 2"
    experiment = (
        "overshoot and return to the same depth; three rates: constant in depth units, whatever rate, load "
        "and indenter; a tag sees it"
    )
    parameters = (Parameter("b", "mm", "play", 0.03, 0.0, 0.6),)
    seen_by_tag = True

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        half = 0.5 * float(values["b"])
        if half == 0.0:
            return state
        # A measured position's noise is taken up by any play: what that would change is no play's doing.
        pose, still = state.pose.copy(), STILL * state.course.dither
        pose[:, 2] += play(pose[:, 2], still + half) - play(pose[:, 2], still) + half
        return replace(state, pose=pose)
