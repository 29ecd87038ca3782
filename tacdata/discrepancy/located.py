"""Where a residual lives, in words and as a table for pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.discrepancy import evidence
from tacdata.discrepancy.fit import t_value
from tacdata.discrepancy.problem import Problem

NOTABLE = 1.3
"""A slice is told of when its mean square is so many times the noise floor [1]..."""
SURE = 3.0
"""...and so many standard errors over episodes above it [1]."""


@dataclass(frozen=True)
class Slice:
    """The whitened residual in one part of the recordings."""

    by: str
    name: str
    mean_square: float
    """Over the noise floor [1]; 1 is noise alone."""
    t: float
    """How far above 1, in standard errors over episodes."""


def residual(problem: Problem) -> np.ndarray:
    """Return the whitened residual without nuisances, shape (m, streams)."""
    same = problem.frame
    column = problem.board.values[:, :, 0]
    return evidence.leftover(
        column, problem.setting.course.reduced, same.noise, same.context, same.features, same.errors
    )


def slices(problem: Problem, white: np.ndarray) -> list[Slice]:
    """Return the residual by phase, depth, rate, place, indenter, clock and channel."""
    course = problem.setting.course.reduced
    square = np.square(white).astype(float)
    each = square.mean(axis=1)
    speed, depth = course.speed, course.tip[:, 2]
    inside = depth > 0 if depth.max() > 0 else depth > depth.min() + 0.1 * course.stroke
    still = np.abs(speed) < 1e-3 * max(float(np.abs(speed).max()), 1e-9)
    parts: list[tuple[str, str, np.ndarray]] = [
        ("phase", "without contact", ~inside), ("phase", "loading", inside & ~still & (speed > 0)),
        ("phase", "hold", inside & still), ("phase", "unloading", inside & ~still & (speed < 0)),
    ]  # fmt: skip
    edges = np.quantile(depth[inside], [0, 1 / 3, 2 / 3, 1]) if inside.any() else np.zeros(4)
    for name, low, high in zip(("shallow", "middle", "deep"), edges[:-1], edges[1:], strict=True):
        parts.append(("depth", f"{name} ({low:.2g} to {high:.2g} mm)", inside & (depth >= low) & (depth <= high)))
    moving = inside & ~still
    if moving.any():
        rates = np.quantile(np.abs(speed[moving]), [0, 1 / 3, 2 / 3, 1])
        for name, low, high in zip(("slow", "medium", "fast"), rates[:-1], rates[1:], strict=True):
            within = moving & (np.abs(speed) >= low) & (np.abs(speed) <= high)
            parts.append(("rate", f"{name} ({low:.2g} to {high:.2g} mm/s)", within))
    clock = course.time / max(float(course.time[-1]), 1e-9)
    parts += [
        ("clock", n, (clock >= k / 3) & (clock <= (k + 1) / 3)) for k, n in enumerate(("first", "second", "last"))
    ]
    parts += [("indenter", t.name, course.tool == k) for k, t in enumerate(course.tools) if len(course.tools) > 1]
    made = [_slice(by, name, each, course.episode, rows) for by, name, rows in parts if rows.sum() > 10]
    kinds = [f"channel {k}" for k in range(course.channels)] + ["force"] * (course.force is not None)
    for k, name in enumerate(kinds[: square.shape[1]]):
        made.append(_slice("stream", name, square[:, k], course.episode, np.ones(len(each), dtype=bool)))
    return made


def _slice(by: str, name: str, each: np.ndarray, episode: np.ndarray, rows: np.ndarray) -> Slice:
    numbers = np.unique(episode[rows])
    means = np.array([each[rows & (episode == n)].mean() for n in numbers])
    return Slice(by, name, float(each[rows].mean()), t_value(means - 1))


def in_words(found: list[Slice]) -> list[str]:
    """Return sentences on the slices that stand out, each kind of slice by itself."""
    told = []
    for by in dict.fromkeys(s.by for s in found):
        own = [s for s in found if s.by == by]
        high = [s for s in own if s.mean_square > NOTABLE and s.t > SURE]
        if not high:
            continue
        if len(high) == len(own) > 2 and max(s.mean_square for s in high) < 2 * min(s.mean_square for s in high):
            told.append(f"{by}: everywhere alike, {np.median([s.mean_square for s in high]):.3g} times the noise floor")
        else:
            high.sort(key=lambda s: -s.mean_square)
            told.append(f"{by}: " + ", ".join(f"{s.name} {s.mean_square:.3g}" for s in high[:4]) + " times the noise")
    return told or ["nowhere does the residual stand out from the noise"]
