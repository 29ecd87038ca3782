"""Internal friction, whatever the rate."""

from dataclasses import replace

import numpy as np

from tacdata.chain.memory import play, slip_lags, slipping
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, Response, State, Values

READ_THRESHOLDS = (0.25, 0.6, 1.0)
"""Thresholds of the slipping elements, over the largest of them [1]: about evenly spaced."""
APART_THRESHOLDS = (0.15, 0.35, 0.55, 0.75, 1.0, 1.3, 1.7)
"""Thresholds of the slipping elements, over the largest of them [1]: about evenly spaced."""


class Hysteresis(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "q = q_e - a q_e / F_e (F_e - mean of stop_r F_e over r of 0.05, 0.15, 0.4 of the largest force), reset at "
        "every touch: unloaded skin holds no friction"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2"
    experiment = "slow loops at three rates: the loop's area stays as the rate goes to 0, and its width grows with load"
    parameters = (Parameter("a", "1", "share carried by friction", 0.1, 0.0, 3.0),)
    at_rest = AtRest.STAYS

    def apply(self, state: State, values: Values) -> State:
        force = np.maximum(state.force, 0.0)
        largest = max(float(force.max()), 1e-12)
        unloaded = state.depth <= 0
        lag = slip_lags(force, largest * np.array([0.05, 0.15, 0.4]), unloaded).mean(axis=0)
        # Bounded, because near release the force vanishes before the lag does.
        share = np.minimum(lag / np.maximum(force, 0.02 * largest), 3.0)
        return state.scaled(np.maximum(1 - values["a"] * share, 0.0))


class BoucWen(Hysteresis):
    """Internal friction that is overcome gradually, whatever the rate."""

    equation = "q = q_e (1 - a (1 - z) / 2), dz/dd = (1 - z sgn d') / w, z = -1 at every touch"
    source = "Bouc-Wen of exponent 1: Wen, J. Eng. Mech. Div. 102 (1976) 249; Dahl, The Aerospace Corp. TOR-158 (1968)"
    parameters = (
        Parameter("a", "1", "lost share of load while unloading", 0.08, 0.0, 0.95),
        Parameter("w", "1", "way by which it turns, over the deepest press", 0.12, 0.01, 2.0, grid=(0.04, 0.12, 0.35)),
    )

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        # Over the deepest press: a turning way has no unit that all skins share.
        width = max(float(values["w"]) * course.span, 1e-9)
        start = np.where(course.first | (state.depth <= 0), -1.0, np.nan)
        z = slipping(np.maximum(state.depth, 0.0), width, start)
        return state.scaled(1 - 0.5 * values["a"] * (1 - z))


class ProportionalHysteresis(Hysteresis):
    """Internal friction in proportion to load, whatever the rate."""

    equation = "q = q_e (1 - a z), z from 0 to 1 as the force falls back by 2 w F_max: (play_w F + w - F) / (2 w)"
    source = "one element of Prandtl-Ishlinskii, scaled by load; Brokate & Sprekels, ch. 2"
    parameters = (
        Parameter("a", "1", "lost share of load while unloading", 0.08, 0.0, 0.95),
        Parameter("w", "1", "half the turning width over the largest force", 0.1, 0.005, 1.0, grid=(0.02, 0.07, 0.2)),
    )

    def apply(self, state: State, values: Values) -> State:
        force = np.maximum(state.force, 0.0)
        width = max(float(values["w"]) * float(force.max()), 1e-12)
        # The output of a play lies its half width below a rising input, and as much above a falling one.
        reversal = np.clip((play(force, width, state.depth <= 0) + width - force) / (2 * width), 0.0, 1.0)
        return state.scaled(1 - values["a"] * reversal)


class HysteresisRead(Hysteresis):
    """Internal friction, whatever the rate, read by a transducer of any power."""

    equation = (
        "r = r_e (max(0, F - a (mean of play_w F + w over w up to w_max - F)) / F)^m, F = F_e^(1/m) over its largest, "
        "reset at every touch"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2; slipping elements: Iwan, J. Appl. Mech. 34 (1967)"
    parameters = (
        Parameter("a", "1", "share of load carried by friction", 0.1, 0.0, 3.0),
        Parameter("w", "1", "largest half band over the largest load", 0.2, 0.005, 2.0, grid=(0.06, 0.15, 0.4)),
        Parameter("m", "1", "power of load by which readings grow", 1.0, 0.3, 4.0, grid=(1.0, 1.7)),
    )

    def apply(self, state: State, values: Values) -> State:
        force, power = np.maximum(state.force, 0.0), float(values["m"])
        # A reading that is a power of the load is taken back to the load first.
        load = (force / max(float(force.max()), 1e-12)) ** (1 / power)
        unloaded, width = state.depth <= 0, float(values["w"])
        lag = slip_lags(load, width * np.array(READ_THRESHOLDS), unloaded).mean(axis=0)
        net = np.maximum(load - values["a"] * lag, 0.0)
        loaded = load > 1e-9
        return state.scaled(np.where(loaded, (net / np.where(loaded, load, 1.0)) ** power, 1.0))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "" if response.fitted else "loads are known, whatever reads them"


class HysteresisApart(Hysteresis):
    """Internal friction that differs between readings and force."""

    equation = (
        "q = q_e(d + b l), F = F_e(d - a l), l = mean of min(d, play_w d + w - d) over w up to w_max, "
        "reset at every touch: a foam stays dense on the way back, and its force falls"
    )
    source = "Prandtl-Ishlinskii; Brokate & Sprekels, ch. 2; slipping elements: Iwan, J. Appl. Mech. 34 (1967)"
    experiment = "slow loops at three rates, of force and readings: both loops' areas stay as the rate goes to 0"
    parameters = (
        Parameter("a", "1", "lost depth of the force over the lag", 0.1, 0.0, 3.0),
        Parameter("b", "1", "gained depth of the readings over the lag", 0.1, -3.0, 3.0),
        Parameter("w", "1", "largest half band over the deepest press", 0.15, 0.01, 2.0, grid=(0.08, 0.25)),
    )

    def apply(self, state: State, values: Values) -> State:
        course, depth, response = state.course, state.depth, state.response
        unloaded, width = depth <= 0, float(values["w"]) * course.span
        lags = slip_lags(depth, width * np.array(APART_THRESHOLDS), unloaded)
        # No element slips below the depth of first touch: the lag ends there, and does not jump.
        lag = np.clip(lags, 0.0, np.maximum(depth, 0.0)).mean(axis=0)
        lag = lag[:, None] * np.array([0.0, 0.0, 1.0])
        poses = state.pose, state.pose + values["b"] * lag, state.pose - values["a"] * lag
        load, more = (response.load(pose, course.tool) for pose in poses[:2])
        force, less = (response.force(pose, course.tool) for pose in poses[::2])
        return replace(state, load=state.load + more - load, force=state.force + less - force)

    def of_force(self, values: Values) -> Values:
        return {**values, "b": -values["a"]}

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "" if course.force is not None else "no force was recorded with the readings"
