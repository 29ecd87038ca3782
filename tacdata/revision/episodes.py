"""Parts of a course: sealed episodes, and groups that are left out to test extrapolation."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tacdata.chain import Course
from tacdata.chain.course import BY_ROW
from tacdata.discrepancy.verdict.sealed import DEEPER, chosen

SHARE = 0.25
"""Share of the episodes that is sealed if the verdict sealed none [1]."""
FEWEST = 3
"""Minimum number of episodes inside and outside a group."""


@dataclass(frozen=True)
class Sealed:
    """Episodes on which the gap is shown."""

    numbers: np.ndarray
    """Their numbers, shape (k,), int64."""
    unseen: bool
    """Whether the verdict was reached without them; otherwise only the effects' parameters are fitted without them."""


def sealed(course: Course, verdict: dict[str, Any]) -> Sealed:
    """Return the episodes that the verdict sealed; if it sealed none, a share chosen by the hash of their names.

    Of a share, no episode is the only one of its place and indenter, or the deepest: a fitted response needs another.

    Args:
        course: The course of the verdict.
        verdict: The verdict's document.
    """
    unseen = chosen(course)
    if len(unseen) and len(unseen) == verdict.get("sealed", {}).get("episodes"):
        return Sealed(unseen, True)
    # By a hash, so that the choice follows neither the order nor the figures of the episodes.
    order = sorted(range(course.episodes), key=lambda k: hashlib.sha256(f"{k} {course.names[k]}".encode()).digest())
    count = max(int(np.ceil(SHARE * course.episodes)), 1)
    picked = _replaceable(course, order, count) or order[:count]
    return Sealed(np.sort(np.array(picked)), False)


def _replaceable(course: Course, order: list[int], count: int) -> list[int]:
    """Return the first episodes of an order whose place and indenter keep one that goes as deep."""
    first = np.searchsorted(course.episode, np.arange(course.episodes))
    context = course.site * len(course.tools) + course.tool[first]
    depth = np.array([course.tip[course.episode == k, 2].max() for k in range(course.episodes)])
    picked: list[int] = []
    for k in order:
        peers = [j for j in np.flatnonzero(context == context[k]).tolist() if j != k and j not in picked]
        if peers and depth[peers].max() >= (1 - DEEPER) * depth[k]:
            picked.append(k)
        if len(picked) == count:
            break
    return picked


def part(course: Course, numbers: np.ndarray) -> Course:
    """Return the course of some episodes, on the same clock."""
    keep = np.sort(np.asarray(numbers))
    rows = np.flatnonzero(np.isin(course.episode, keep))
    values = {name: value[rows] for name in BY_ROW if (value := getattr(course, name)) is not None}
    values["episode"] = np.searchsorted(keep, values["episode"])
    return replace(
        course,
        **values,
        session=course.session[keep],  # ty: ignore[invalid-argument-type]
        recording=None if course.recording is None else np.unique(course.recording[keep], return_inverse=True)[1],  # ty: ignore[invalid-argument-type]
        # A clock that began with an episode left out begins with the next one.
        restarts=None if course.restarts is None else np.diff(np.cumsum(course.restarts)[keep], prepend=0) > 0,  # ty: ignore[invalid-argument-type]
        site=course.site[keep],  # ty: ignore[invalid-argument-type]
        names=tuple(course.names[k] for k in keep),
        specimens=tuple(course.specimens[k] for k in keep) if course.specimens else (),
    )


def groups(course: Course) -> list[tuple[str, np.ndarray]]:
    """Return groups of episodes that differ from all others by rate, depth or indenter; each is left out in turn."""
    number = np.arange(course.episodes)
    inside = course.tip[:, 2] > 0  # the approach is as fast in every episode
    speed = np.array([np.abs(course.speed[inside & (course.episode == e)]).max(initial=0.0) for e in number])
    deepest = np.array([course.tip[course.episode == e, 2].max() for e in number])
    tool = np.array([course.tool[course.episode == e][0] for e in number])
    groups_of: list[tuple[str, np.ndarray]] = []
    for what, unit, values in (("rate", "mm/s", np.round(speed, 2)), ("depth", "mm", np.round(deepest, 2))):
        # A quarter at either end, if the two ends differ enough to call it another rate or depth.
        low, high = np.quantile(values, [0.25, 0.75])
        if high > 1.2 * low > 0:
            groups_of.append((f"slowest {what}s" if what == "rate" else "shallowest", number[values <= low]))
            groups_of.append((f"{what} from {high:.2g} {unit}", number[values >= high]))
    if len(course.tools) > 1:
        groups_of += [(f"indenter {t.name}", number[tool == k]) for k, t in enumerate(course.tools)]
    return [(name, numbers) for name, numbers in groups_of if FEWEST <= len(numbers) <= course.episodes - FEWEST]
