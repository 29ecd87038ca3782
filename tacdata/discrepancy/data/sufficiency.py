"""Gaps of recordings, and the next ones to record."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.data.tip_motion import HOLD, longest_hold, speeds

FEWEST_EPISODES = 8
"""Fewest episodes for a name: with fewer, the standard error over them is too uncertain."""
RATE_RATIO, ALIKE = 2.5, 1.3
"""Rates: least ratio that distinguishes lags from play, and largest ratio that counts as a single rate [1]."""


def shortcomings(course: Course) -> list[str]:
    """Return the faults of recordings as sentences, each with its remedy."""
    remarks = list(course.notes)
    if course.episodes < FEWEST_EPISODES:
        remarks.append(
            f"{course.episodes} episodes are too few for a verdict: record {FEWEST_EPISODES} or more, better 40, "
            "presses of several depths and rates (`tacdata plan diagnostic`)"
        )
    if course.episodes > 1 and one_rate(course):
        wide = max(_spread(rates) for rates in speeds(course))
        what = "one rate only" if wide < ALIKE else f"most presses differ in rate by a factor of {wide:.1f} only"
        remarks.append(f"{what}: delay, filter, backlash and relaxation look alike; record three rates over a decade")
    if course.tip[:, 2].min() > 0.05 * course.stroke and course.tip[:, 2].max() > 0:
        remarks.append("never without contact: idle readings are not known; begin and end every press off the skin")
    if _tared(course):
        remarks.append("every episode begins at the same reading, as if tared: drift and set are lost; record un-tared")
    return remarks + units(course) + stuck(course)


def limitations(course: Course) -> list[str]:
    """Return the questions that such a protocol cannot answer as sentences, each with its remedy."""
    remarks = []
    if longest_hold(course) < HOLD:
        remarks.append("no hold of a second or more: relaxation and baseline tracking show in holds; hold for 60 s")
    elif not _recovers(course):
        remarks.append("no rest after release: record the recovery, as long as the longest hold")
    depths = np.array([course.tip[course.episode == e, 2].max() for e in range(course.episodes)])
    reach = float(depths.max()) if depths.max() > 0 else course.stroke
    if len(depths) > 1 and np.ptp(depths) < 0.15 * reach:
        remarks.append("one depth only: record three")
    if any(t.shape == "unknown" or not np.isfinite(t.radius) for t in course.tools):
        remarks.append("an indenter without a known radius: what depends on it is not judged")
    if len(course.tools) < 2:
        remarks.append("one indenter: compliance, stiffening and poroelasticity need a second radius")
    if course.force is None:
        remarks.append("no force beside the readings: stiffness and gain, relaxing skin and taxel cannot be separated")
    if course.tag is None:
        remarks.append("no second observation of the pose: guide and skin are separated by their response alone")
    return remarks


def one_rate(course: Course) -> bool:
    """Return whether all episodes press at about the same rate, and all let go at about the same.

    How they come to the skin does not count.
    """
    return not any(_spread(rates) >= RATE_RATIO for rates in speeds(course))


def _spread(rates: np.ndarray) -> float:
    """Return by which factor rates differ, the outermost tenths aside; 1 where none is known."""
    finite = rates[np.isfinite(rates)]
    low, high = np.quantile(finite, [0.1, 0.9]) if len(finite) else (0.0, 0.0)
    return float(high / low) if low > 0 else 1.0


STROKE, RATE, RADIUS, EVERY = 0.02, 500.0, 200.0, (2e-5, 5.0)
"""Sizes beyond are hardly of their unit: strokes [mm], rates [mm/s], radii [mm], intervals [s].

A long stroke is no reason to doubt: strips are stretched by tens of mm. An import refuses impossible presses.
"""


def units(course: Course) -> list[str]:
    """Return remarks on quantities of an unexpected size for their unit."""
    remarks = []
    if course.stroke < STROKE:
        remarks.append(f"strokes of {course.stroke:.3g} mm: is the depth in mm? Say its unit in the import mapping")
    if float(np.abs(course.speed).max()) > RATE:
        remarks.append(f"presses of {np.abs(course.speed).max():.3g} mm/s: are times in s and lengths in mm?")
    if any(np.isfinite(t.radius) and t.radius > RADIUS for t in course.tools):
        remarks.append(f"an indenter of {max(t.radius for t in course.tools):.3g} mm radius: is it in mm?")
    reduced = course.reduced
    interval = float(np.median(reduced.step[~reduced.first])) if not reduced.first.all() else 0.0
    if not EVERY[0] < interval < EVERY[1]:
        remarks.append(f"a reading every {interval:.3g} s: are times in s?")
    return remarks


def stuck(course: Course) -> list[str]:
    """Return in words which channels, or the second observation, have no information in some episodes."""
    remarks, reduced = [], course.reduced
    episodes = np.unique(reduced.episode)
    still = np.array([np.ptp(reduced.readings[reduced.episode == e], axis=0) == 0 for e in episodes])
    for channel in np.flatnonzero(still.any(axis=0) & ~still.all(axis=0)):
        count = int(still[:, channel].sum())
        if count > 0.1 * len(episodes) and still[:, channel].mean() > 2 * np.median(still.mean(axis=0)):
            label = course.channel_names[channel]
            remarks.append(
                f"{label}: the same reading throughout {count} of {len(episodes)} episodes: stuck at times; "
                "mend its contact, or leave it out"
            )
    for name, values in (("force", course.force), ("tag", None if course.tag is None else course.tag[:, 2])):
        if values is not None and np.isfinite(values[course.read]).mean() < 0.5:
            share = 100 * (1 - np.isfinite(values[course.read]).mean())
            remarks.append(f"{name}: missing at {share:.0f} % of the readings")
    return remarks


def _recovers(course: Course) -> bool:
    for e in range(course.episodes):
        rows = np.flatnonzero(course.episode == e)
        top = rows[np.argmax(course.tip[rows, 2])]
        away = max(0.0, float(course.tip[rows, 2].min()) + 0.02 * course.stroke)
        recovery = rows[(rows > top) & (course.tip[rows, 2] <= away)]
        if len(recovery) > 1 and course.time[recovery[-1]] - course.time[recovery[0]] > 2.0:
            return True
    return False


def _tared(course: Course) -> bool:
    reduced = course.reduced
    starts = np.array(
        [reduced.readings[np.flatnonzero(reduced.episode == e)[:3]].mean(axis=0) for e in np.unique(reduced.episode)]
    )
    level = np.abs(starts).max()
    return bool(course.episodes > 3 and level < 1e-3 * np.ptp(reduced.readings))
