"""The skin resists faster presses more."""

from dataclasses import replace

import numpy as np

from tacdata.effects.dry_friction import FRICTION, many_channels
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, Response, State, Values

UNIT_RATE = 1.0
"""Rate at which the share is given [mm/s]."""


class Viscosity(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.SKIN_MEMORY
    equation = "r = r_e max(0, 1 + k sgn(v) |v / (1 mm/s)|^n), v the rate of depth"
    source = "n = 1: Kelvin-Voigt; n < 1: rubber, Bergstrom & Boyce, J. Mech. Phys. Solids 46, 1998, 931"
    experiment = "presses at three rates over a decade: peaks grow with the rate, and readings are constant in a hold"
    parameters = (
        Parameter("k", "1", "share added at 1 mm/s", 0.05, 0.0, 2.0),
        Parameter("n", "1", "power of the rate", 0.5, 0.1, 1.5, grid=(0.25, 0.6, 1.0)),
    )
    at_rest = AtRest.FALLS_BACK

    def apply(self, state: State, values: Values) -> State:
        rate = state.course.speed / UNIT_RATE
        # A skin never pulls: a fast release takes the load to zero, not below.
        factor = np.maximum(1 + values["k"] * np.sign(rate) * np.abs(rate) ** values["n"], 0.0)
        return state.scaled(factor)

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "the tip never moves" if not np.any(course.speed) else ""


class Drag(Viscosity):
    """Drag with a size of its own, where no elastic load comes with it: it grows with the rate alone."""

    stage = "readout"
    moves = ("signal",)
    by_channel = True
    equation = (
        "s = s_e + D R sgn(v) |v / V|^n, v the rate of depth, V its largest; R: the range of the readings of a place"
    )
    source = "n = 1: a dashpot; n = 2: a fluid through an orifice"
    experiment = "strokes at three rates over a decade: the loop's height grows with the rate, and a stop ends it"
    parameters = (
        replace(FRICTION, name="D", meaning="drag at full rate over the range of the readings"),
        Parameter("n", "1", "power of the rate", 1.0, 0.5, 2.0, grid=(1.0, 2.0)),
    )

    def apply(self, state: State, values: Values) -> State:
        rate = state.course.speed
        turn = np.sign(rate) * np.abs(rate / max(float(np.abs(rate).max()), 1e-9)) ** float(values["n"])
        return state.with_signal(state.signal + turn[:, None] * (values["D"] * state.response.swing(state.signal)))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return super().unjudgeable(course, response) or many_channels(course)
