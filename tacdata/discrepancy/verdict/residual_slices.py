"""Mean squares of a residual by slices of the recordings, as sentences and as a table for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.levels.corners import places
from tacdata.discrepancy.search.problem import Problem
from tacdata.discrepancy.statistics.gram_fit import t_value

NOTABLE = 1.3
"""A slice is notable from this mean square on [noise floor]..."""
NOTABLE_T = 3.0
"""...and from so many standard errors over episodes on [1]."""
NOWHERE = "the residual stands out from the noise nowhere"
SPREAD = "no part stands out in most presses; over all of them it is {:.2f}"


@dataclass(frozen=True)
class Slice:
    """The whitened residual in one part of the recordings."""

    by: str
    name: str
    mean_square: float
    """Over the noise floor [1]; 1 is noise alone."""
    t: float
    """How far above 1, in standard errors over episodes."""


def whitened_residual(problem: Problem) -> np.ndarray:
    """Return the whitened residual without nuisances, shape (m, streams)."""
    return problem.null.whitener.whitened(problem.board.columns[0][:, :, None])[:, :, 0]


PHASES = ("without contact", "loading", "hold", "unloading")
"""Phases of a press."""


def phases(course: Course) -> np.ndarray:
    """Return the phase of each row, as an index into `PHASES`, shape (rows,), int64."""
    speed, depth = course.speed, course.tip[:, 2]
    inside = depth > 0 if depth.max() > 0 else depth > depth.min() + 0.1 * course.stroke
    still = np.abs(speed) < 1e-3 * max(float(np.abs(speed).max()), 1e-9)
    return np.where(~inside, 0, np.where(still, 2, np.where(speed > 0, 1, 3)))


def slices(problem: Problem) -> list[Slice]:
    """Return the residual by phase, depth, rate, place, indenter, clock and channel."""
    course = problem.setting.course.reduced
    square = np.square(whitened_residual(problem)).astype(float)
    each = square.mean(axis=1)
    speed, depth, phase = course.speed, course.tip[:, 2], phases(course)
    inside, still = phase != PHASES.index("without contact"), phase == PHASES.index("hold")
    parts = [("phase", name, phase == k) for k, name in enumerate(PHASES)]
    edges = np.quantile(depth[inside], [0, 1 / 3, 2 / 3, 1]).round(6) if inside.any() else np.zeros(4)
    for name, low, high in zip(("shallow", "middle", "deep"), edges[:-1], edges[1:], strict=True):
        parts.append(("depth", f"{name} ({_range(low, high)} mm)", inside & (depth >= low) & (depth <= high)))
    moving = inside & ~still
    if moving.any():
        rates = np.quantile(np.abs(speed[moving]), [0, 1 / 3, 2 / 3, 1])
        for name, low, high in zip(("slow", "medium", "fast"), rates[:-1], rates[1:], strict=True):
            within = moving & (np.abs(speed) >= low) & (np.abs(speed) <= high)
            parts.append(("rate", f"{name} ({_range(low, high)} mm/s)", within))
    clock = course.time / max(float(course.time[-1]), 1e-9)
    parts += [
        ("clock", n, (clock >= k / 3) & (clock <= (k + 1) / 3)) for k, n in enumerate(("first", "second", "last"))
    ]
    parts += [("place", name, presses[course.episode]) for name, presses in places(course)]
    parts += [("indenter", t.name, course.tool == k) for k, t in enumerate(course.tools) if len(course.tools) > 1]
    parts_of_residual = [_slice(by, name, each, course.episode, rows) for by, name, rows in parts if rows.sum() > 10]
    kinds = [*course.channel_names, *["force"] * (course.force is not None)]
    for k, name in enumerate(kinds[: square.shape[1]]):
        parts_of_residual.append(_slice("stream", name, square[:, k], course.episode, np.ones(len(each), dtype=bool)))
    return parts_of_residual


def figure(value: float) -> str:
    """Return a number with three digits, and no power of ten."""
    return f"{value:.0f}" if value >= 100 else f"{value:#.3g}"


def _range(low: float, high: float) -> str:
    """Return two numbers as a range, as one where they round to the same."""
    return " to ".join(dict.fromkeys(f"{value:.2g}" if value < 100 else f"{value:.0f}" for value in (low, high)))


def _slice(by: str, name: str, each: np.ndarray, episode: np.ndarray, rows: np.ndarray) -> Slice:
    numbers = np.unique(episode[rows])
    means = np.array([each[rows & (episode == n)].mean() for n in numbers])
    return Slice(by, name, float(each[rows].mean()), t_value(means - 1))


def beside(base: list[Slice], final: list[Slice]) -> list[dict[str, Any]]:
    """Return slices of the same parts before and after, as in the verdict's file."""
    return [
        {"by": b.by, "name": b.name, "before": b.mean_square, "after": a.mean_square}
        for b, a in zip(base, final, strict=True)
    ]


ALONE = 9.0
"""An episode is an outlier when its mean square is so many times the median of all [1]."""
FEW_ALONE = 0.2
"""Largest share of the episodes that can be outliers [1]."""


def outstanding(names: Sequence[str], energy: np.ndarray, values: np.ndarray) -> list[str]:
    """Return the outlying episodes as a sentence: no statistic over episodes detects these few.

    Args:
        names: Of the episodes.
        energy: Half the whitened sum of squares of each [1], shape (episodes,).
        values: Whitened values behind each [1], shape (episodes,).
    """
    rows = np.flatnonzero(values > 0)
    if len(rows) < 4:
        return []
    square = 2 * energy[rows] / values[rows]
    usual = float(np.median(square))
    high = rows[square > ALONE * max(usual, 1.0)]
    if not 0 < len(high) <= FEW_ALONE * len(rows):
        return []
    order = sorted(high.tolist(), key=lambda k: -energy[k] / values[k])
    words = ", ".join(f"{names[k]} {2 * energy[k] / values[k]:.3g}" for k in order[:5])
    return [
        f"episode: {words}, the others {usual:.3g}: {len(high)} of {len(rows)} stand out by "
        "themselves; look at them, or record what they did again"
    ]


def in_words(residual_slices: list[Slice], single: list[str] | None = None, total: float = 1.0) -> list[str]:
    """Return sentences on the notable slices, ``single`` first, then each kind, with mean squares [noise floor].

    Args:
        residual_slices: The slices.
        single: Sentences on single episodes.
        total: The mean square of all [noise floor].
    """
    words, alike = list(single or []), []
    for by in dict.fromkeys(s.by for s in residual_slices):
        members = [s for s in residual_slices if s.by == by]
        high = [s for s in members if s.mean_square > NOTABLE and s.t > NOTABLE_T]
        if not high:
            continue
        if len(high) == len(members) > 2 and max(s.mean_square for s in high) < 2 * min(s.mean_square for s in high):
            alike.append((by, float(np.median([s.mean_square for s in high]))))
        else:
            high.sort(key=lambda s: -s.mean_square)
            words.append(f"{by}: {', '.join(f'{s.name} at {figure(s.mean_square)}' for s in high[:4])}")
    if alike:
        usual = [level for _, level in alike]
        extent = _range(min(usual), max(usual))
        words.append(f"{', '.join(by for by, _ in alike)}: everywhere alike, {extent}")
    return words or [SPREAD.format(total) if total > NOTABLE else NOWHERE]
