"""Presses of the same kind in both sessions, laid on one clock: the same place, depth, pace and indenter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.chain import Course

SAME_DEPTH = 0.05
"""Presses whose depths differ by less are of one kind [1]."""
SAME_PACE = 0.12
"""Presses whose durations above half of their depth differ by less are of one kind [1]."""
FEWEST = 3
"""Presses of a kind that each session needs: their scatter is the noise."""
POINTS = 120
"""Points of a press on its clock."""
SIGNAL = 2.0
"""A base with less variance along the press, over that of its noise, is noise [1]."""
HALF = 0.5
"""Share of the depth at which clocks are set: the path is steep there [1]."""


@dataclass(frozen=True)
class PressKind:
    """All presses of one kind, on one clock."""

    name: str
    """Its factors: specimen or place, its depth, its speed."""
    time: np.ndarray
    """Since the start of the press [s], shape (t,)."""
    depth: np.ndarray
    """Mean depth of the healthy presses [mm], shape (t,)."""
    healthy: np.ndarray
    """Readings of the healthy presses in the order of time [the source's unit], shape (h, t, channels)."""
    measured: np.ndarray
    """Readings of the other presses [the source's unit], shape (m, t, channels)."""
    effort: bool | None = None
    """Whether channels are an effort of the drive, as a current, or a response; None: the source says neither."""

    @property
    def base(self) -> np.ndarray:
        """Mean of the healthy presses at the same point of the path [the source's unit], shape (t, channels)."""
        return self.healthy.mean(axis=0)

    @property
    def difference(self) -> np.ndarray:
        """Mean of the other presses minus the base [the source's unit], shape (t, channels)."""
        return self.measured.mean(axis=0) - self.base

    @property
    def range(self) -> np.ndarray:
        """Range of the base [the source's unit], shape (channels,); of one that never moves there, that of all."""
        base, every = np.ptp(self.base, axis=0), np.ptp(np.concatenate([self.healthy, self.measured]), axis=(0, 1))
        return np.where(base > 0, base, np.where(every > 0, every, 1.0))

    @property
    def reliable(self) -> np.ndarray:
        """Whether the base varies along the press more than by the noise of its mean, shape (channels,), bool."""
        still = self.healthy - self.healthy.mean(axis=1, keepdims=True)
        noise = still.var(axis=0, ddof=1).mean(axis=0) / len(still)
        return self.base.var(axis=0) > SIGNAL * noise

    def split(self, first: np.ndarray) -> PressKind:
        """Return the healthy presses alone: some as the reference of the others, for a control."""
        return replace(self, healthy=self.healthy[first], measured=self.healthy[~first])


@dataclass(frozen=True)
class Matched:
    """The conditions that both sessions hold."""

    conditions: tuple[PressKind, ...]
    unmatched: int
    """Presses without enough counterparts."""
    channels: tuple[str, ...]


def matched(course: Course, names: Sequence[str], measured: np.ndarray) -> Matched:
    """Return the conditions of a course that holds both sessions.

    Args:
        course: Healthy and other recordings, read together.
        names: Specimen of each episode as the source names it; empty where it names none.
        measured: Whether an episode is of the other machine, shape (episodes,), bool.
    """
    rows = [np.flatnonzero((course.episode == e) & (course.averaged > 0)) for e in range(course.episodes)]
    spans = [_span(course, r) for r in rows]
    groups: list[list[int]] = []
    for e in range(course.episodes):
        same = next((g for g in groups if _same(course, names, spans, g[0], e)), None)
        groups.append([e]) if same is None else same.append(e)
    conditions, count = [], 0
    for group in groups:
        members = np.array(group)
        enough = min(measured[members].sum(), (~measured[members]).sum()) >= FEWEST
        if not enough:
            count += len(group)
            continue
        conditions.append(_on_one_clock(course, rows, spans, members, measured, names))
    return Matched(_distinct(conditions), count, course.channel_names)


@dataclass(frozen=True)
class _Span:
    """Size and pace of a press."""

    depth: float
    """[mm]"""
    start: float
    """When it first passes half of its depth [s]."""
    pace: float
    """Time until it passes it for the last time [s]."""


def _span(course: Course, rows: np.ndarray) -> _Span:
    time, depth = course.time[rows], course.tip[rows, 2]
    low, high = float(depth.min()), float(depth.max())
    level = low + HALF * (high - low)
    # Either way: of an axis that points the other way a press begins where it is deepest.
    after = np.flatnonzero(np.diff(depth >= level)) + 1
    if not len(after):
        return _Span(high - low, float(time[0]), float(time[-1] - time[0]))
    # Between two readings: else presses would be aligned to whole periods only.
    share = (level - depth[after - 1]) / (depth[after] - depth[after - 1])
    passed = time[after - 1] + share * (time[after] - time[after - 1])
    end = passed[-1] if len(passed) > 1 else time[-1]
    return _Span(high - low, float(passed[0]), float(end - passed[0]))


def _same(course: Course, names: Sequence[str], spans: list[_Span], a: int, b: int) -> bool:
    first, second = spans[a], spans[b]
    place = np.array([course.tip[course.episode == e][0, :2] for e in (a, b)])
    tool = [course.tool[np.searchsorted(course.episode, e)] for e in (a, b)]
    return (
        names[a] == names[b]
        and tool[0] == tool[1]
        and float(np.linalg.norm(place[0] - place[1])) < PLACE
        and abs(first.depth - second.depth) <= SAME_DEPTH * max(first.depth, second.depth)
        and abs(first.pace - second.pace) <= SAME_PACE * max(first.pace, second.pace)
    )


PLACE = 0.15
"""Presses no farther apart are at one place [mm]."""


def _on_one_clock(
    course: Course,
    rows: list[np.ndarray],
    spans: list[_Span],
    group: np.ndarray,
    measured: np.ndarray,
    names: Sequence[str],
) -> PressKind:
    """Return presses resampled to common times; each point is the mean of the readings around it."""
    lead = min(spans[e].start - course.time[rows[e][0]] for e in group)
    tail = min(course.time[rows[e][-1]] - spans[e].start for e in group)
    step = {e: float(np.median(np.diff(course.time[rows[e]]))) for e in group}
    coarsest = max(np.median([step[e] for e in group if measured[e] == side]) for side in (False, True))
    # A machine that is read more often would seem to have less of a filter.
    rows_of = {e: rows[e][:: max(round(coarsest / step[e]), 1)] for e in group}
    count = int(min(POINTS, np.median([len(r) for r in rows_of.values()])))
    edges = np.linspace(-lead, tail, count + 1)
    since = {e: course.time[r] - spans[e].start for e, r in rows_of.items()}
    values = {e: _means(since[e], course.readings[r], edges) for e, r in rows_of.items()}
    depths = [_means(since[e], course.tip[r, 2:], edges)[:, 0] for e, r in rows_of.items() if not measured[e]]
    sides = [np.stack([values[e] for e in group if measured[e] == side]) for side in (False, True)]
    speed = np.abs(np.diff(np.mean(depths, axis=0)) / np.diff(edges[:-1]))
    at = course.tip[rows[group[0]][0], :2]
    name = names[group[0]] or f"x {at[0]:.2g}, y {at[1]:.2g} mm"
    # A way in the air before the contact is no depth; a hold or a rest may last longer than the motion.
    deepest = float(np.max(depths[0]))
    deep = min(spans[group[0]].depth, deepest if deepest > 0 else np.inf)
    label = f"{name}, {deep:.3g} mm deep at {np.median(speed[speed > HALF * speed.max()]):.2g} mm/s"
    middle = 0.5 * (edges[1:] + edges[:-1]) + lead
    return PressKind(label, middle, np.mean(depths, axis=0), *sides, effort=course.effort)


def _means(time: np.ndarray, values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the mean of the line through values between edges, shape (edges - 1, columns)."""
    means = []
    for column in values.T:
        finite = np.isfinite(column)
        if finite.sum() < 2:
            means.append(np.full(len(edges) - 1, np.nan))
            continue
        at, value = time[finite], column[finite]
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(at))])
        # Between its points the integral is a parabola; readings are dense enough for straight pieces.
        fine = np.interp(edges, at, integral)
        means.append(np.diff(fine) / np.diff(edges))
    return np.column_stack(means)


def _distinct(conditions: list[PressKind]) -> tuple[PressKind, ...]:
    """Return conditions under the shortest names that still distinguish them."""
    places = {c.name.partition(" mm, ")[0] for c in conditions}
    if len(conditions) > 1 and len(places) == 1 and places.pop().startswith("x "):
        return tuple(replace(c, name=c.name.partition(" mm, ")[2]) for c in conditions)
    short = [c.name.partition(", ")[0] if not c.name.startswith("x ") else c.name for c in conditions]
    if len(set(short)) == len(short):
        return tuple(replace(c, name=s) for c, s in zip(conditions, short, strict=True))
    return tuple(conditions)
