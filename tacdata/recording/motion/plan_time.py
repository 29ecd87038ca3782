"""Estimates how long a plan takes, before there is a rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.plans import Plan
from tacdata.recording.motion.preflight import SECONDS_PER_PRESS
from tacdata.recording.motion.press_steps import Position, duration, steps
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.rig import Registration

USUAL_LIMITS = AxisLimits(np.array([200.0, 200.0, 100.0]), np.array([50.0, 50.0, 15.0]))
"""Acceleration [mm/s^2] and speed [mm/s] of a small desktop guide, used where the rig's own are unknown."""
SECONDS_PER_MOUNTING = 60.0
"""Time that a person takes to mount an indenter and zero its tip [s]."""


@dataclass(frozen=True)
class PlanTime:
    """Expected duration of a plan."""

    press_seconds: tuple[float, ...]
    """Expected duration of each press [s]."""
    mountings: int
    """How often a person mounts or turns an indenter."""

    @property
    def seconds(self) -> float:
        """Expected time of the presses [s], without mounting."""
        return sum(self.press_seconds)


def plan_time(plan: Plan, limits: AxisLimits = USUAL_LIMITS) -> PlanTime:
    """Return how long each press takes with these axis limits."""
    seconds, position, place = [], None, Registration((0.0, 0.0, 0.0), 0.0)
    for press in plan.presses:
        path = steps(press, plan.motion, place)
        # Where the guide will be at the start is not known yet.
        start: Position = position or path[0].target or (0.0, 0.0, 0.0)
        needed, position = duration(path, start, limits)
        seconds.append(needed + SECONDS_PER_PRESS)
    order = [press.mounting for press in plan.presses]
    return PlanTime(tuple(seconds), sum(a != b for a, b in zip(order, [None, *order[:-1]], strict=True)))
