"""Limits of the machine that pressed: its speeds, its acceleration and the height from which it begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.chain import Course
from tacdata.plans import Plan
from tacdata.recording.motion.plan_time import USUAL_LIMITS
from tacdata.recording.motion.trapezoid import AxisLimits

RATES = (0.15, 0.5, 2.0, 6.0)
"""Speeds of a rig of our own to choose from [mm/s]."""
SHARES = (0.03, 0.1, 0.3, 1.0)
"""Speeds of a foreign machine to choose from, as shares of the fastest that it showed [1]."""
FASTEST = 0.99
"""Quantile of the recorded speeds that counts as the fastest: single rows may jump [1]."""
CLEAR = 0.3
"""Height from which the guide goes down, and to which it comes back [mm]."""


@dataclass(frozen=True)
class MachineLimits:
    """What a next press may ask of a machine."""

    rates: tuple[float, ...]
    """Speeds to choose from [mm/s]."""
    lowest: float
    """Depth at which presses begin and end [mm]: negative above the skin, never beyond what the machine showed."""
    limits: AxisLimits
    """What it accelerates by."""

    @classmethod
    def of_plan(cls, plan: Plan, limits: AxisLimits = USUAL_LIMITS) -> MachineLimits:
        """Return the limits of a rig of our own: no faster than its plan travels."""
        return cls(tuple(r for r in RATES if r <= plan.motion.travel_speed), -CLEAR, limits)

    @classmethod
    def of_course(cls, course: Course) -> MachineLimits:
        """Return the limits that a foreign machine showed: its fastest stroke, its range, its sharpest turn.

        A sine of amplitude A and peak speed v turns with v^2 / A; a ramp turns at least as sharply.
        """
        moving = np.abs(course.speed[np.abs(course.speed) > 0])
        fastest = float(np.quantile(moving, FASTEST)) if len(moving) else RATES[0]
        sharpest = 2 * fastest**2 / course.stroke
        rates = tuple(float(f"{share * fastest:.2g}") for share in SHARES)
        limits = AxisLimits(np.full(3, sharpest), np.full(3, fastest))
        return cls(rates, max(-CLEAR, float(course.tip[:, 2].min())), limits)
