"""What the way of pressing cannot split, whatever the fits say: real things have other forms than any library."""

from __future__ import annotations

from tacdata.chain import Course
from tacdata.discrepancy.amiss import one_rate
from tacdata.discrepancy.motion import HOLD, longest_hold

BY_RATE: tuple[str, ...] = (
    "latency", "low_pass_filter", "servo_lag", "backlash", "hysteresis", "quantization_hysteresis", "creep",
)  # fmt: skip
"""Mechanisms that differ by how they follow the rate."""
BY_HOLD = "relaxation"


def inseparable(course: Course, mechanism: str, time: float = 0.0) -> tuple[str, ...]:
    """Return mechanisms that presses of one rate, or without holds, cannot tell from one, in words of the library.

    Args:
        course: The recordings.
        mechanism: The one.
        time: Its time constant [s], if it has one: a hold that is over before says little of it.
    """
    group: list[str] = [*BY_RATE] if one_rate(course) else []
    if group and longest_hold(course) < max(HOLD, time):
        group.append(BY_HOLD)
    return tuple(name for name in group if name != mechanism) if mechanism in group else ()
