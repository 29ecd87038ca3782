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
INNER = (0.2, 0.8)
"""Shares of a stroke between which its speed is taken: single rows of a measured path jump [1]."""
CLEAR = 0.3
"""Height from which the guide goes down, and to which it comes back [mm]."""


@dataclass(frozen=True)
class MachineLimits:
    """Limits of a machine for the next presses."""

    rates: tuple[float, ...]
    """Speeds to choose from [mm/s]."""
    lowest: float
    """Depth at which presses begin and end [mm]: negative above the skin, never beyond the recorded range."""
    limits: AxisLimits
    """Its acceleration."""

    @classmethod
    def of_plan(cls, plan: Plan, limits: AxisLimits = USUAL_LIMITS) -> MachineLimits:
        """Return the limits of a rig of our own: no faster than its plan travels."""
        return cls(tuple(r for r in RATES if r <= plan.motion.travel_speed), -CLEAR, limits)

    @classmethod
    def of_course(cls, course: Course) -> MachineLimits:
        """Return the limits that a foreign machine showed: its fastest stroke, its range, its sharpest turn.

        A sine of amplitude A and peak speed v turns with v^2 / A; a ramp turns at least as sharply.
        """
        fastest = max((_pace(course, e) for e in range(course.episodes)), default=0.0) or RATES[0]
        # v^2 = 2 a s, as if it had reached its fastest in a quarter of the stroke.
        sharpest = 2 * fastest**2 / course.stroke
        rates = tuple(float(f"{share * fastest:.2g}") for share in SHARES)
        limits = AxisLimits(np.full(3, sharpest), np.full(3, fastest))
        return cls(rates, max(-CLEAR, float(course.tip[:, 2].min())), limits)


def _pace(course: Course, episode: int) -> float:
    """Return the faster of a stroke's ways in and out [mm/s]; 0 if it holds no way."""
    rows = np.flatnonzero(course.episode == episode)
    time, depth = course.time[rows], course.tip[rows, 2]
    top, pace = int(np.argmax(depth)), 0.0
    # Above the skin a path may wait; in contact it moves.
    for bottom in {float(depth.min()), max(float(depth.min()), 0.0)}:
        low, high = (bottom + share * (float(depth[top]) - bottom) for share in INNER)
        for way in (slice(0, top + 1), slice(top, None)):
            inside = np.flatnonzero((depth[way] >= low) & (depth[way] <= high))
            # Two rows alone may be a jump of the path.
            if len(inside) > 2:
                span = float(np.ptp(time[way][inside]))
                pace = max(pace, float(np.ptp(depth[way][inside])) / max(span, 1e-9))
    return pace
