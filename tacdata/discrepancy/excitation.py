"""What the way of pressing cannot split, whatever the fits say: real things have other forms than any library."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.amiss import longest_hold

RATES = 2.5
"""Rates of pressing must differ by such a factor for lags to be told from play and friction [1]."""
HOLD = 1.0
"""A hold must last so long for relaxation to be told from them [s]."""
TOUCHING = 0.02
"""Depth, over the largest of all, from which on a speed is one of pressing and not of the way there [1]."""
BY_RATE: tuple[str, ...] = (
    "latency", "low_pass_filter", "servo_lag", "backlash", "hysteresis", "quantization_hysteresis", "creep",
)  # fmt: skip
"""Mechanisms that differ by how they follow the rate."""
BY_HOLD = "relaxation"


def one_rate(course: Course) -> bool:
    """Return whether all episodes are pressed at about the same rate; how they come to the skin does not count."""
    deep = course.tip[:, 2] > TOUCHING * course.span
    touching = deep & np.append(False, deep[:-1])  # a speed is the way from the row before
    pressed = np.unique(course.episode[touching])
    speeds = np.array([np.abs(course.speed[touching & (course.episode == e)]).max() for e in pressed])
    low, high = np.quantile(speeds, [0.1, 0.9]) if len(speeds) else (0.0, 0.0)
    return bool(high < RATES * low or high <= 0)


def inseparable(course: Course, mechanism: str) -> tuple[str, ...]:
    """Return mechanisms that presses of one rate, or without holds, cannot tell from one, in words of the library."""
    group: list[str] = [*BY_RATE] if one_rate(course) else []
    if group and longest_hold(course) < HOLD:
        group.append(BY_HOLD)
    return tuple(name for name in group if name != mechanism) if mechanism in group else ()
