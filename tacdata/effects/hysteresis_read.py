"""Internal friction, whatever the rate, read by a transducer of any power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.chain import Course, Response, State
from tacdata.chain.memory import slip_lags
from tacdata.effects.effect import AtRest, Effect, Family, Parameter

THRESHOLDS = (0.25, 0.6, 1.0)
"""Of the elements that slip, over the largest of them [1]: about as many at any."""


class HysteresisRead(Effect):
    """Internal friction, whatever the rate, read by a transducer of any power."""

    title = "Internal friction, whatever the rate, read by a transducer of any power"
    catalogue = ("M6", "G10")
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "r = r_e (max(0, F - a (mean of play_w F + w over w up to w_max - F)) / F)^m, F = F_e^(1/m) over its largest, "
        "anew at every touch"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2; slipping elements: Iwan, J. Appl. Mech. 34 (1967)"
    experiment = "slow loops at three rates: the loop's area stays as the rate goes to 0, and its width grows with load"
    parameters = (
        Parameter("a", "1", "share of load carried by friction", 0.1, 0.0, 3.0),
        Parameter("w", "1", "largest half band over the largest load", 0.2, 0.005, 2.0, grid=(0.06, 0.15, 0.4)),
        Parameter("m", "1", "power of load by which readings grow", 1.0, 0.3, 4.0, grid=(1.0, 1.7)),
    )
    at_rest = AtRest.STAYS
    mechanism = "hysteresis"

    def apply(self, state: State, values: dict[str, np.ndarray]) -> State:
        """Return the state after it."""
        force, power = np.maximum(state.force, 0.0), float(values["m"])
        load = (force / max(float(force.max()), 1e-12)) ** (1 / power)
        free, most = state.depth <= 0, float(values["w"])
        late = slip_lags(load, most * np.array(THRESHOLDS), free).mean(axis=0)
        left = np.maximum(load - values["a"] * late, 0.0)
        there = load > 1e-9
        ease = np.where(there, (left / np.where(there, load, 1.0)) ** power, 1.0)
        return replace(state, load=state.load * ease[:, None], force=state.force * ease)

    def unjudgeable(self, course: Course, response: Response) -> str:
        """Return why such recordings cannot show it; empty if they may."""
        return "" if response.fitted else "loads are known, whatever reads them"
