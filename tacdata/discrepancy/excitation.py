"""What the way of pressing cannot split, whatever the fits say: real things have other forms than any library."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.amiss import one_rate
from tacdata.discrepancy.motion import HOLD, longest_hold
from tacdata.effects import load

BY_RATE: tuple[str, ...] = (
    "latency", "low_pass_filter", "servo_lag", "backlash", "hysteresis", "quantization_hysteresis", "creep",
)  # fmt: skip
"""Mechanisms that differ by how they follow the rate."""
BY_HOLD = "relaxation"
BY_PRESS, BY_CLOCK = "wear_in", "gain_drift"
"""A form of softening, and a mechanism, that differ by whether presses or time count."""
EVEN = 0.995
"""Presses are even if their number at a place and the clock are correlated as much, or more [1]."""


def inseparable(course: Course, mechanism: str, time: float = 0.0, form: str = "") -> tuple[str, ...]:
    """Return mechanisms that presses of one rate, without holds, or evenly spaced, cannot tell from one.

    Args:
        course: The recordings.
        mechanism: The one.
        time: Its time constant [s], if it has one: a hold that is over before says little of it.
        form: The file of the effect that stands for it.
    """
    group: list[str] = [*BY_RATE] if one_rate(course) else []
    if group and longest_hold(course) < max(HOLD, time):
        group.append(BY_HOLD)
    more = [name for name in group if name != mechanism] if mechanism in group else []
    if (form == BY_PRESS or mechanism == BY_CLOCK) and _even(course):
        more.append(BY_CLOCK if form == BY_PRESS else load(BY_PRESS).called)
    return tuple(more)


def _even(course: Course) -> bool:
    """Return whether the number of presses at a place so far says what the clock says."""
    first = course.time[course.first]
    before = np.array([np.sum(course.site[:k] == course.site[k]) for k in range(course.episodes)], dtype=float)
    return bool(np.ptp(before) > 0 and np.corrcoef(before, first)[0, 1] > EVEN)
