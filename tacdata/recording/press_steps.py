"""One press as the moves and pauses that the controller is given, each move from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.plans import Press
from tacdata.plans.plan import MotionSettings
from tacdata.recording.motion_profile import AxisLimits
from tacdata.rig import Registration

SYNC = 0.01
"""Pause that makes the controller finish its moves before it answers [s]; GRBL rounds up to 0.05 s."""

Position = tuple[float, float, float]


@dataclass(frozen=True)
class Step:
    """A move or a pause."""

    phase: str
    """Phase it belongs to; empty for travel."""
    target: Position | None = None
    """Machine position to go to [mm]; None for a pause."""
    speed: float = 0.0
    """Speed of the move [mm/s]."""
    seconds: float = 0.0
    """Length of the pause [s]."""


def steps(press: Press, motion: MotionSettings, registration: Registration) -> tuple[Step, ...]:
    """Return the steps of one press: travel, rest, approach, press, hold, release, retract.

    A pause stands behind every move: the next one then starts from rest, as the profile of `motion_profile`
    takes it, and the pause's acknowledgement bounds the move's end. A press with negative depth stops above
    the skin.
    """
    near = min(max(motion.standoff, -press.depth), motion.clearance)
    above, standoff, deepest = (
        registration.to_machine(press.x, press.y, depth) for depth in (-motion.clearance, -near, press.depth)
    )
    return (
        Step("", above, motion.travel_speed),
        Step("rest", seconds=max(motion.rest, SYNC)),
        Step("approach", standoff, motion.approach_speed),
        Step("approach", seconds=SYNC),
        Step("press", deepest, press.speed),
        Step("hold", seconds=max(press.hold, SYNC)),
        Step("release", standoff, press.speed),
        Step("release", seconds=SYNC),
        Step("", above, motion.approach_speed),
        Step("", seconds=SYNC),
    )


def duration(path: tuple[Step, ...], start: Position, limits: AxisLimits) -> tuple[float, Position]:
    """Return how long the steps take from ``start`` [s], without the link's delays, and their end [mm]."""
    seconds, position = 0.0, start
    for step in path:
        seconds += step.seconds
        if step.target is not None:
            move = limits.straight_move(np.array(position), np.array(step.target), step.speed)
            seconds, position = seconds + move.duration, step.target
    return seconds, position
