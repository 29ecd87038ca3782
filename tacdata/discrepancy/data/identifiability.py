"""What the way of pressing cannot split, whatever the fits say: real things have other forms than any library."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.data.sufficiency import one_rate
from tacdata.discrepancy.data.tip_motion import HOLD, longest_hold, stairs
from tacdata.effects import Effect, load

CATCHING_UP: tuple[str, ...] = ("latency", "low_pass_filter", "servo_lag")
"""Mechanisms that differ by how they follow the rate, and are over while the tip stands."""
STAYING: tuple[str, ...] = ("backlash", "hysteresis", "quantization_hysteresis")
"""Those that stay as they are while it stands: a staircase tells them from the others."""
SLOW: tuple[str, ...] = ("creep", "relaxation")
"""Those that go on while it stands, the latter so much that a hold as long as its time tells it."""
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
    group = _group(course, mechanism, time)
    more = [name for name in group if name != mechanism] if mechanism in group else []
    if (form == BY_PRESS or mechanism == BY_CLOCK) and _even(course):
        more.append(BY_CLOCK if form == BY_PRESS else load(BY_PRESS).called)
    return tuple(more)


def lookalikes(course: Course, effect: Effect, values: Mapping[str, np.ndarray | float]) -> tuple[str, ...]:
    """Return mechanisms that a course cannot tell from an effect with some values, as `inseparable`."""
    time = max((float(value) for name, value in values.items() if name.startswith("tau")), default=0.0)
    return inseparable(course, effect.called, time, effect.name)


def _group(course: Course, mechanism: str, time: float) -> list[str]:
    """Return what looks alike at one rate."""
    if not one_rate(course):
        return []
    held = longest_hold(course) >= max(HOLD, time)
    if not stairs(course):
        return [*CATCHING_UP, *STAYING, *(SLOW[:1] if held else SLOW)]
    if mechanism in CATCHING_UP:
        return [*CATCHING_UP]
    if held:
        return []
    return [*STAYING, *SLOW] if mechanism in SLOW else [mechanism, *SLOW]


def _even(course: Course) -> bool:
    """Return whether the number of presses at a place so far says what the clock says."""
    first = course.time[course.first]
    before = np.array([np.sum(course.site[:k] == course.site[k]) for k in range(course.episodes)], dtype=float)
    return bool(np.ptp(before) > 0 and np.corrcoef(before, first)[0, 1] > EVEN)
