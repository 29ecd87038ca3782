"""Dry friction of a guide or a seal: the same force against every motion, at any rate and depth."""

from dataclasses import replace

import numpy as np

from tacdata.chain.memory import slipping
from tacdata.effects.effect import AtRest, Course, Effect, Family, Parameter, Response, State, Values, Whole

FEW = 4
"""Most channels with a friction, or a drag, of their own size; more share the pattern of a load."""
FRICTION = Parameter(
    "F", "1", "friction over the range of the readings", 0.1, -1.0, 1.0, per_channel=True, of=Whole.RANGE
)


def _of_stroke(name: str, meaning: str, typical: float, low: float, high: float, grid: tuple[float, ...]) -> Parameter:
    return Parameter(name, "1", f"{meaning} over half the stroke", typical, low, high, 0.0, grid, of=Whole.HALF_STROKE)


class DryFriction(Effect):
    stage = "mechanics"
    moves = ("signal", "force")
    group = "loading and unloading"
    family = Family.FRICTION_AND_PLAY
    equation = (
        "q = q_e + a q_top (1 + z) / 2, dz/dd = (1 - z sgn d') / w, z = -1 at every touch; q_top: q_e at the deepest "
        "point of the place"
    )
    source = "Coulomb, with presliding after Dahl, The Aerospace Corp. TOR-158 (1968)"
    experiment = (
        "strokes to three depths at three rates: the loop is as wide at every depth and rate, and opens within a short "
        "way after each reversal"
    )
    parameters = (
        Parameter("a", "1", "width of the loop over the largest load without it", 0.08, 0.0, 5.0),
        Parameter(
            "w",
            "1",
            "way by which it turns, over the deepest press",
            0.01,
            0.0005,
            0.1,
            grid=(0.004, 0.02, 0.06),
            of=Whole.DEEPEST,
        ),
    )
    at_rest = AtRest.STAYS

    def unjudgeable(self, course: Course, response: Response) -> str:
        return "channels are an effort, which sees friction only while the drive moves" if course.effort else ""

    def apply(self, state: State, values: Values) -> State:
        course = state.course
        way = max(float(values["w"]) * course.span, 1e-9)
        # Above the skin nothing rubs.
        depth = np.maximum(state.depth, 0.0)
        start = np.where(course.first | (state.depth <= 0), -1.0, np.nan)
        turn = 0.5 * float(values["a"]) * (1 + slipping(depth, way, start))
        # By the load at the deepest point, so that the loop is as wide at every depth.
        top = _deepest(course, depth)
        return replace(
            state, load=state.load + turn[:, None] * state.load[top], force=state.force + turn * state.force[top]
        )


class SealFriction(DryFriction):
    """Dry friction with a size of its own, where no elastic load comes with it: a seal, a guide, a brake."""

    stage = "readout"
    moves = ("signal",)
    by_channel = True
    equation = "s = s_e + F R z, w dz/du = |1 - z sgn u'|^p, u the depth; R: the range of the readings of a place"
    source = "p near 0: Jenkins, J. Appl. Mech. 29, 1962, 457; p = 1: Dahl, The Aerospace Corp. TOR-158 (1968)"
    parameters = (
        FRICTION,
        _of_stroke("w", "way by which it turns,", 0.02, 0.001, 0.3, (0.005, 0.02, 0.08)),
        Parameter("p", "1", "power of the turn, from sudden to gradual", 0.5, 0.02, 1.5, grid=(0.5,)),
    )

    def apply(self, state: State, values: Values) -> State:
        return _rubbed(state, values["F"], self.turn(state, values))

    def turn(self, state: State, values: Values) -> np.ndarray:
        """Return the friction over its largest value [1], shape (n,)."""
        course, half = state.course, 0.5 * state.course.stroke
        # A form without a clearance has no parameter b.
        way, gap = max(float(values["w"]) * half, 1e-9), float(values.get("b", 0.0)) * half
        # Strokes of one recording follow each other. One that begins at the top came from below, and so on.
        first = course.first
        if course.recording is not None:
            first = np.diff(course.recording[course.episode], prepend=-1) != 0
        begins = np.flatnonzero(first)
        low, high = (reach.reduceat(state.depth, begins) for reach in (np.minimum, np.maximum))
        start = np.full(course.rows, np.nan)
        start[begins] = 2 * (state.depth[begins] - low) / np.maximum(high - low, 1e-9) - 1
        return slipping(state.depth, way, start, gap, float(values["p"]))

    def unjudgeable(self, course: Course, response: Response) -> str:
        return super().unjudgeable(course, response) or many_channels(course)


class FrictionClearance(SealFriction):
    """Dry friction behind a clearance: after a reversal nothing rubs until the clearance is crossed."""

    equation = (
        "s = s_e + F R z, w dz/du = |1 - z sgn u'|^p but for a way b at z = 0, u the depth; R: the range of the "
        "readings of a place"
    )
    source = "a gap in series with Dahl's element; Coble et al., Dataset Friction Damper with Backlash (2022)"
    experiment = "strokes to three depths: after each reversal the force is zero over the same way"
    parameters = (
        FRICTION,
        _of_stroke("b", "clearance", 0.1, 0.005, 1.0, (0.05, 0.14, 0.35)),
        _of_stroke("w", "way by which it rises,", 0.03, 0.001, 0.3, (0.015, 0.05)),
        *SealFriction.parameters[2:],
    )


class EffortFriction(SealFriction):
    """Dry friction in an effort, as a motor's current or a piston's pressure: only while the drive moves."""

    equation = (
        "s = s_e + F R v / (|v| + c V), v the rate of depth, V its largest; R: the range of the readings of a place"
    )
    source = "Coulomb; the regulator of the position asks for the effort"
    experiment = "strokes at three rates with stops: the step at each start is the same, and over at each stop"
    parameters = (
        FRICTION,
        Parameter("c", "1", "rate by which it turns, over the largest", 0.05, 0.001, 1.0, grid=(0.02,)),
    )

    def turn(self, state: State, values: Values) -> np.ndarray:
        """Return the friction over its largest value [1], shape (n,)."""
        rate = state.course.speed
        # Smooth about zero, so that noise of a path at rest is no friction.
        return rate / (np.abs(rate) + float(values["c"]) * max(float(np.abs(rate).max()), 1e-9))

    def unjudgeable(self, course: Course, response: Response) -> str:
        if course.effort is False:
            return "channels are a response, in which friction stays at rest"
        return many_channels(course) or ("" if np.any(course.speed) else "the tip never moves")


def many_channels(course: Course) -> str:
    """Return the reason why so many channels show no force of their own size; empty for few."""
    return "many channels share the pattern of a load" if course.channels > FEW else ""


def _rubbed(state: State, share: np.ndarray, turn: np.ndarray) -> State:
    """Return the state with a friction of a share of the readings' range."""
    return state.with_signal(state.signal + turn[:, None] * (share * state.response.swing(state.signal)))


def _deepest(course: Course, depth: np.ndarray) -> np.ndarray:
    """Return for each row the deepest row of its place and tool, shape (n,), int64."""
    of = np.unique(course.row_site * (int(course.tool.max()) + 1) + course.tool, return_inverse=True)[1]
    order = np.lexsort((depth, of))
    last = np.append(np.flatnonzero(np.diff(of[order])), len(order) - 1)
    return order[last][of]
