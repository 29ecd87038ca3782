"""Identifiability: which effects these presses cannot tell apart, whatever the fits say.

Real effects have other forms than any library. Small differences in fit do not split two of them; the way of pressing
must. The needs of each effect are its class data (`tacdata.effects.Effect`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.data.sufficiency import one_rate
from tacdata.discrepancy.data.tip_motion import HOLD, longest_hold, pressing_time, stairs
from tacdata.effects import AtRest, Effect, library

QUICK = 0.2
"""Relaxation so much shorter than a press takes is a lag of the other sign: one rate does not split them [1]."""
OVER = 5.0
"""A lag is over in a hold of so many times its length [1]."""
NEARLY_ONE = 0.2
"""Two delays that differ by less are one that another form rounds: a filter's edges are late by unequal times [1]."""
SAME_CLOCK = 0.995
"""Presses are evenly spaced from this correlation of their number at a place with the clock on [1]."""


def lookalikes(course: Course, effect: Effect, values: Mapping[str, np.ndarray | float]) -> tuple[str, ...]:
    """Return mechanisms that a course cannot distinguish from an effect with values.

    Presses of one rate, without holds, or evenly spaced, leave several open. So do two delays that hardly differ.

    Args:
        course: The recordings.
        effect: The effect.
        values: Of its parameters, as far as they are known.
    """
    alike = _at_one_rate(course, effect, values)
    rivals = [name for name in alike if name != effect.called] if effect.called in alike else []
    if _nearly_one(effect, values):
        rivals += [name for name in _that(AtRest.CATCHES_UP) if name not in (effect.called, *rivals)]
    if effect.grows_with is not None and _evenly_spaced(course):
        rivals += sorted({e.called for e in library() if e.grows_with not in (None, effect.grows_with)})
    return tuple(rivals)


def _at_one_rate(course: Course, effect: Effect, values: Mapping[str, np.ndarray | float]) -> list[str]:
    """Return the mechanisms that are indistinguishable at one rate; none if there are several rates."""
    if effect.at_rest is None or not one_rate(course):
        return []
    arrays = {p.name: np.asarray(values.get(p.name, 0.0)) for p in effect.parameters}
    hold, lag = longest_hold(course), max(effect.time_constant(arrays), effect.delay(arrays))
    is_held = hold >= max(HOLD, effect.time_constant(arrays))
    if (
        effect.at_rest is AtRest.CATCHES_UP
        and effect.delay(arrays) >= 0
        and (stairs(course) or hold >= max(HOLD, OVER * lag))
    ):
        # At a stop it catches up, and is done: play stays behind there, a relaxing reading falls, a creeping one goes
        # on.
        return _that(AtRest.CATCHES_UP)
    if not stairs(course):
        quick = effect.at_rest is AtRest.RELAXES and 0 < effect.time_constant(arrays) < QUICK * pressing_time(course)
        slow = (AtRest.GOES_ON,) if is_held and not quick else (AtRest.GOES_ON, AtRest.RELAXES)
        return _that(AtRest.CATCHES_UP, AtRest.FALLS_BACK) + _that(AtRest.STAYS) + _that(*slow)
    if effect.at_rest in (AtRest.CATCHES_UP, AtRest.FALLS_BACK):
        return _that(AtRest.CATCHES_UP, AtRest.FALLS_BACK)
    if is_held:
        return []
    if effect.at_rest is AtRest.STAYS:
        return [effect.called, *_that(AtRest.GOES_ON, AtRest.RELAXES)]
    return _that(AtRest.STAYS) + _that(AtRest.GOES_ON, AtRest.RELAXES)


def _nearly_one(effect: Effect, values: Mapping[str, np.ndarray | float]) -> bool:
    """Return whether an effect is late by two times that hardly differ."""
    delays = [float(values.get(p.name, 0.0)) for p in effect.parameters if p.unit == "s"]
    alike = len(delays) == 2 and float(np.ptp(delays)) < NEARLY_ONE * float(np.abs(delays).max())
    return alike and effect.at_rest is AtRest.CATCHES_UP


def _that(*kinds: AtRest) -> list[str]:
    """Return the mechanisms that do some of this at rest, by name."""
    return sorted({e.called for e in library() if e.at_rest in kinds})


def _evenly_spaced(course: Course) -> bool:
    """Return whether the number of presses at a place so far is collinear with the clock."""
    first = course.time[course.first]
    counts = np.array([np.sum(course.site[:k] == course.site[k]) for k in range(course.episodes)], dtype=float)
    return bool(np.ptp(counts) > 0 and np.corrcoef(counts, first)[0, 1] > SAME_CLOCK)
