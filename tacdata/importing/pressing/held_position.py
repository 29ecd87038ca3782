"""A position that repeats an old value while the machine moves on: logged more slowly, dropped out, or stuck.

The readings decide. At a real rest they do not go on as in a motion, and they do not rise and come back.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.importing.streams import Stream


@dataclass(frozen=True)
class HeldPolicy:
    """Limits of a position that may rest. None was tuned on data."""

    rows: int = 3
    """Fewest rows of one value that can be old [rows]."""
    updates: int = 10
    """Fewest changes of a position that show its own rate [count]."""
    inside: float = 0.5
    """Smallest share of the readings' change that comes between two updates [1]. A machine that moves in stairs has
    less."""
    later: float = 0.25
    """Smallest share of that change in the second half [1]. Readings that lag behind a stair have less."""
    jump: float = 0.1
    """Smallest jump after an old value [path's range]."""
    faster: float = 3.0
    """Smallest ratio of that jump to the usual steps [1]."""
    near: float = 0.05
    """Largest distance of two positions at one place [path's range]."""
    stuck: int = 10
    """Fewest rows of a stuck value [rows]."""
    returns: float = 0.3
    """Smallest rise and fall of the readings while the position is stuck [their range]."""
    explained: float = 0.7
    """Smallest share of the readings' variance that the position explains elsewhere [1]. The current of a drive rises
    and falls at a standstill, too."""
    noise: float = 5.0
    """Smallest change of the readings that is none of noise [its size]."""


POLICY = HeldPolicy()
PLACES = 20
"""Parts of a path's range in each of which readings are averaged."""


@dataclass(frozen=True)
class HeldRows:
    """Rows of a position that are no measurement of it."""

    repeated: np.ndarray
    """Rows that repeat the row before while the machine moves, shape (rows,), bool."""
    stuck: tuple[tuple[int, int], ...]
    """First and last row of each stretch in which the position is stuck."""
    every: int
    """Rows from one update of the position to the next; 0 if it is updated in each row."""


def held_rows(position: Stream, readings: np.ndarray, span: float, policy: HeldPolicy = POLICY) -> HeldRows:
    """Return the rows of a position that hold an old value.

    Args:
        position: The path.
        readings: The channels at its times [their unit], shape (rows, channels).
        span: Range of the path [mm].
        policy: The limits.
    """
    path = position.values
    repeated = np.zeros(len(path), dtype=bool)
    updates = np.flatnonzero((path[1:] != path[:-1]).any(axis=1)) + 1
    if len(updates) < policy.rows or span <= 0:
        return HeldRows(repeated, (), 0)
    answer = _answer(path, readings)
    runs = list(pairwise([0, *updates.tolist(), len(path)]))
    # The lower quartile: rests make intervals longer, and nothing makes them shorter.
    interval = int(np.quantile(np.diff(updates), 0.25, method="lower"))
    between = [run for run in runs[1:-1] if run[1] - run[0] >= policy.rows]
    if interval >= policy.rows and len(updates) >= policy.updates and _goes_on(path, answer, between, policy):
        for begin, end in runs[:-1]:
            # Only the last interval of a run: before it the machine may have rested.
            repeated[max(begin + 1, end - interval + 1) : end] = True
    else:
        interval = 0
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        threshold = max(policy.jump * span, policy.faster * float(np.median(steps[steps > 0])))
        for run in between:
            sharp = steps[run[1] - 1] > threshold
            if sharp and _goes_on(path, answer, [run], policy) and _arrived(path, answer, run, span, policy):
                repeated[run[0] + 1 : run[1]] = True
    stuck = tuple((a, b - 1) for a, b in runs if b - a >= policy.stuck and _returns(answer, a, b, policy))
    # Readings that do not follow the position elsewhere say nothing of where it is here.
    if _explained(path, answer, stuck) < policy.explained:
        stuck = ()
    for first, last in stuck:
        repeated[first : last + 1] = False
    return HeldRows(repeated, stuck, interval)


def _answer(path: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """Return the readings as one number that follows the path [1], shape (rows,), smoothed over three rows."""
    deviations = np.nan_to_num(readings - np.nanmedian(readings, axis=0))
    axis = int(np.argmax(np.ptp(path, axis=0)))
    spread = deviations.std(axis=0)
    weights = np.where(spread > 0, (deviations * (path[:, axis] - path[:, axis].mean())[:, None]).mean(axis=0), 0.0)
    answer = (deviations / np.where(spread > 0, spread, 1.0)) @ (weights / np.where(spread > 0, spread, 1.0))
    padded = np.concatenate([answer[:1], answer, answer[-1:]])
    return np.median([padded[:-2], padded[1:-1], padded[2:]], axis=0)


def _explained(path: np.ndarray, answer: np.ndarray, stuck: tuple[tuple[int, int], ...]) -> float:
    """Return the share of the readings' variance that the position explains outside of some stretches [1]."""
    others = np.ones(len(path), dtype=bool)
    for first, last in stuck:
        others[first : last + 1] = False
    axis = int(np.argmax(np.ptp(path, axis=0)))
    place, values = path[others, axis], answer[others]
    if len(values) < PLACES or np.ptp(place) <= 0:
        return 0.0
    part = np.minimum((PLACES * (place - place.min()) / np.ptp(place)).astype(int), PLACES - 1)
    counts = np.maximum(np.bincount(part, minlength=PLACES), 1)
    means = np.bincount(part, values, PLACES) / counts
    whole = float(values.var())
    return 1.0 - float(np.mean((values - means[part]) ** 2)) / whole if whole > 0 else 0.0


def _goes_on(path: np.ndarray, answer: np.ndarray, runs: list[tuple[int, int]], policy: HeldPolicy) -> bool:
    """Return whether the readings go on evenly from one update of the path to the next, as in a motion."""
    axis = int(np.argmax(np.ptp(path, axis=0)))
    inside = later = total = 0.0
    for begin, end in runs:
        way = np.sign(path[end, axis] - path[end - 1, axis])
        middle = (begin + end - 1) // 2
        inside += way * (answer[end - 1] - answer[begin])
        later += way * (answer[end - 1] - answer[middle])
        total += way * (answer[end] - answer[begin])
    noise = float(np.median(np.abs(np.diff(answer)))) * len(runs)
    return total > policy.noise * noise and inside >= policy.inside * total and later >= policy.later * inside


def _arrived(path: np.ndarray, answer: np.ndarray, run: tuple[int, int], span: float, policy: HeldPolicy) -> bool:
    """Return whether the readings at the end of a run are those of the next place and no longer those of its own.

    A skin that relaxes in a hold, before a fast way back, is still far from there.
    """
    begin, end = run
    remainder = np.ones(len(path), dtype=bool)
    remainder[begin:end] = False
    levels = []
    for place in (path[begin], path[end]):
        near = remainder & (np.linalg.norm(path - place, axis=1) <= policy.near * span)
        if near.sum() < policy.rows:
            return False
        levels.append(float(np.median(answer[near])))
    return abs(answer[end - 1] - levels[1]) < abs(answer[end - 1] - levels[0])


def _returns(answer: np.ndarray, begin: int, end: int, policy: HeldPolicy) -> bool:
    """Return whether the readings leave their values at both ends of a stretch, and come back."""
    inside = answer[begin:end]
    low, high = np.quantile(answer, [0.01, 0.99])
    threshold = max(policy.returns * (high - low), policy.noise * float(np.median(np.abs(np.diff(answer)))))
    away = np.minimum(np.abs(inside - inside[0]), np.abs(inside - inside[-1]))
    same_side = (inside > max(inside[0], inside[-1])) | (inside < min(inside[0], inside[-1]))
    return bool((away[same_side] >= threshold).sum() >= policy.rows)
