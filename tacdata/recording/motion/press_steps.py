"""One press as the moves and pauses for the controller, each move from rest to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tacdata.plans import Press
from tacdata.plans.plan import MotionSettings
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.rig import Registration

SYNC = 0.01
"""Pause that makes the controller finish its moves before it answers [s]."""
REPORT_LAG = 0.1
"""Longest time from the making of a report to the feed hold that follows it [s]."""
SHORTEST_PAUSE = 0.05
"""Such a pause as GRBL rounds it up [s]."""

SIDES = {"": (0.0, 0.0), "+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}
"""Direction from a site to where the guide comes from, for each value of `Press.approach_from`."""

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
    """Return the steps of one press: travel, rest, approach, press, hold, release, retract, recovery.

    A pause follows every move. So the next move starts from rest, as `trapezoid` assumes, and the pause's
    acknowledgement bounds the move's end. A press with negative depth stops above the skin. One with ``approach_from``
    rests ``run_up`` away from its site and comes over it from there. Strokes come before the hold.
    """
    # Above the standoff the way down is halved, so that approach and press are both moves.
    high = -press.depth >= motion.standoff
    near = (motion.clearance - press.depth) / 2 if high else min(motion.standoff, motion.clearance)
    above, standoff, target = (
        registration.to_machine(press.x, press.y, depth) for depth in (-motion.clearance, -near, press.depth)
    )
    pause = motion.rest if press.rest is None else press.rest
    x, y = (c + motion.run_up * step for c, step in zip((press.x, press.y), SIDES[press.approach_from], strict=True))
    path = [Step("", registration.to_machine(x, y, -motion.clearance), motion.travel_speed)]
    # A pause is answered when it ends, so it dates the end of the move before it. Without one, queued moves would have
    # no times.
    path += [Step("rest", seconds=max(pause, SYNC))]
    if press.approach_from:
        path += [Step("approach", above, motion.travel_speed), Step("approach", seconds=SYNC)]
    path += [Step("approach", standoff, motion.approach_speed), Step("approach", seconds=SYNC)]
    # Deeper first: the last way to the target is then out of the skin, and friction acts the other way.
    if press.overshoot:
        beyond = registration.to_machine(press.x, press.y, press.deepest)
        path += [Step("press", beyond, press.speed), Step("press", seconds=SYNC)]
    up = registration.to_machine(press.x, press.y, press.depth - press.stroke)
    turn = [
        Step("press", seconds=SYNC),
        Step("press", up, press.speed),
        Step("press", seconds=SYNC),
        Step("press", target, press.speed),
    ]
    turns = turn * press.strokes
    return (
        *path,
        Step("press", target, press.speed),
        *turns,
        Step("hold", seconds=max(press.hold, SYNC)),
        Step("release", standoff, press.speed),
        Step("release", seconds=SYNC),
        Step("", above, motion.approach_speed),
        Step("", seconds=max(press.recovery, SYNC)),
    )


def with_safe_travel(motion: MotionSettings, limits: AxisLimits, report_rate: float) -> MotionSettings:
    """Return motion settings whose travel can be stopped within the clearance above the skin.

    A damaged line can send the tip down; it is noticed at the next report, and then the machine brakes.

    Args:
        motion: The plan's settings.
        limits: The controller's axis limits.
        report_rate: Status reports per second [Hz].
    """
    seconds, braking = 1.0 / report_rate + REPORT_LAG, float(limits.acceleration.min())
    # The largest v with v t + v^2 / (2 a) = clearance: the way until the report is read, and while braking.
    fastest = braking * (np.sqrt(seconds**2 + 2.0 * motion.clearance / braking) - seconds)
    return replace(motion, travel_speed=min(motion.travel_speed, float(fastest)))


def duration(path: tuple[Step, ...], start: Position, limits: AxisLimits) -> tuple[float, Position]:
    """Return how long the steps take from ``start`` [s], without latencies of the link, and where they end [mm]."""
    seconds, position = 0.0, start
    for step in path:
        seconds += step.seconds
        if step.target is not None:
            move = limits.straight_move(np.array(position), np.array(step.target), step.speed)
            seconds, position = seconds + move.duration, step.target
    return seconds, position
