"""What recordings cannot carry, and what to record next."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course

FEWEST = 8
"""Fewer episodes carry no name."""


def amiss(course: Course) -> list[str]:
    """Return in words what is missing from recordings, each with its remedy."""
    told = list(course.notes)
    if course.episodes < FEWEST:
        told.append(
            f"{course.episodes} episodes are too few for a verdict: record {FEWEST} or more, better 40, presses of "
            "several depths and rates (`tacdata plan diagnostic`)"
        )
    speeds = np.array([np.abs(course.speed[course.episode == e]).max() for e in range(course.episodes)])
    if len(speeds) > 1 and speeds.max() < 2 * max(np.median(speeds), 1e-9) and speeds.min() > 0.5 * np.median(speeds):
        told.append(
            "one rate only: delay, filter, backlash and relaxation look alike; record three rates over a decade"
        )
    if longest_hold(course) < 1.0:
        told.append("no hold of a second or more: relaxation and baseline tracking show in holds; hold for 60 s")
    elif not _recovers(course):
        told.append("no rest after release: record the recovery, as long as the longest hold")
    depths = np.array([course.tip[course.episode == e, 2].max() for e in range(course.episodes)])
    reach = float(depths.max()) if depths.max() > 0 else course.stroke
    if len(depths) > 1 and np.ptp(depths) < 0.15 * reach:
        told.append("one depth only: record three")
    if course.tip[:, 2].min() > 0.05 * course.stroke and course.tip[:, 2].max() > 0:
        told.append("never without contact: idle readings are not known; begin and end every press off the skin")
    if _tared(course):
        told.append("every episode begins at the same reading, as if tared: drift and set are lost; record un-tared")
    if any(t.shape == "unknown" or not np.isfinite(t.radius) for t in course.tools):
        told.append("an indenter without a known radius: what depends on it is not judged")
    if len(course.tools) < 2:
        told.append("one indenter: compliance, stiffening and poroelasticity need a second radius")
    if course.force is None:
        told.append("no force: stiffness and gain, relaxing skin and relaxing taxel cannot be told apart")
    if course.tag is None:
        told.append("no second observation of the pose: the guide and the skin are told apart by their response alone")
    return told


def longest_hold(course: Course) -> float:
    """Return the longest rest at depth [s]."""
    deep = course.tip[:, 2] > course.tip[:, 2].min() + 0.3 * course.stroke
    still = (np.abs(course.speed) < 1e-4) & ~course.first & deep
    longest = current = 0.0
    for step, rests in zip(course.step, still, strict=True):
        current = current + float(step) if rests else 0.0
        longest = max(longest, current)
    return longest


def _recovers(course: Course) -> bool:
    for e in range(course.episodes):
        rows = np.flatnonzero(course.episode == e)
        top = rows[np.argmax(course.tip[rows, 2])]
        after = rows[(rows > top) & (course.tip[rows, 2] <= course.tip[rows, 2].min() + 0.02 * course.stroke)]
        if len(after) > 1 and course.time[after[-1]] - course.time[after[0]] > 2.0:
            return True
    return False


def _tared(course: Course) -> bool:
    reduced = course.reduced
    starts = np.array([reduced.readings[np.flatnonzero(reduced.episode == e)[:3]].mean(axis=0)
                       for e in range(course.episodes)])  # fmt: skip
    level = np.abs(starts).max()
    return bool(course.episodes > 3 and level < 1e-3 * np.ptp(reduced.readings))
