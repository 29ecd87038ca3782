"""Chooses a joint path as a whole: of the postures that reach each target, those that follow each other without a jump.

An arm reaches most targets in several postures (elbow up or down). Solved row by row, its path may change posture in
one frame. So other postures are searched at the jumps and at some rows between, and each is continued in both
directions. Dynamic programming (R. Bellman, 1957) then finds the longest chain of rows that the joints can follow. Rows
outside it are left out and named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from tacdata.replay.kinematic_search import KinematicSearch
from tacdata.replay.kinematics import Joint

JUMP = {"rad": 15.0, "m": 2.0}
"""Speed above which a joint jumps, where its own limit is not higher [rad/s, m/s]."""
ANCHORS, STARTS = 8, 6
"""Number of rows at which other postures are searched, and of random starts at each."""
MISSES = 3
"""Rows in a row that a posture may miss before its continuation ends [count]."""
CALM = 0.25
"""Share of that speed at which a posture may be changed while rows are left out [1]."""
WINDOW = 90
"""Rows that a chain may leave out at a time [count]."""
ALIKE = 1e-3
"""Difference of joint values up to which two postures are the same [rad or m]."""
COST = 1e-3
"""Cost of a motion as fast as a jump, in rows reached [1]: among equally long chains the slowest motion is taken."""


def without_jumps(
    search: KinematicSearch,
    aim: Callable[[int], None],
    is_reached: Callable[[np.ndarray], bool],
    values: np.ndarray,
    reached: np.ndarray,
    time_ns: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint path without jumps, and which rows it serves.

    Args:
        search: The search for single rows.
        aim: Sets the targets of a row.
        is_reached: Whether joint values reach the targets that are set.
        values: Solved row by row [rad or m], shape (n, joints).
        reached: Rows whose targets these values reach, shape (n,), bool.
        time_ns: Times [ns], shape (n,).

    Returns:
        Joint values, shape (n, joints), NaN in rows that are left out; rows served, shape (n,), bool.
    """
    joints, seconds = search.model.joints, (time_ns - time_ns[0]) * 1e-9
    postures = np.where(reached[:, None], values, np.nan)
    if reached.any() and len(jumps := _jumps(joints, postures, seconds)):
        tracks = list(_tracks(search, aim, is_reached, postures, jumps))
        postures = _longest_chain(joints, np.stack(tracks, axis=1), seconds)
    served = np.asarray(np.isfinite(postures).all(axis=1))
    return _nearest_turns(joints, postures, search.model.home), served


def _limits(joints: tuple[Joint, ...]) -> np.ndarray:
    return np.array([max(JUMP[joint.unit], joint.velocity or 0.0) for joint in joints])


def _difference(joints: tuple[Joint, ...], later: np.ndarray, earlier: np.ndarray) -> np.ndarray:
    """Return differences of joint values [rad or m]; of joints without limits by the nearest turn."""
    turning = np.array([joint.unit == "rad" and joint.lower is None for joint in joints])
    difference = later - earlier
    return np.asarray(np.where(turning, (difference + np.pi) % (2 * np.pi) - np.pi, difference))


def _jumps(joints: tuple[Joint, ...], values: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Return the rows that the joints reach from the one served before only by a jump."""
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    steps = np.abs(_difference(joints, values[rows[1:]], values[rows[:-1]]))
    return rows[1:][(steps > _limits(joints) * np.diff(seconds[rows])[:, None]).any(axis=1)]


def _tracks(
    search: KinematicSearch,
    aim: Callable[[int], None],
    is_reached: Callable[[np.ndarray], bool],
    postures: np.ndarray,
    jumps: np.ndarray,
) -> Iterator[np.ndarray]:
    """Yield the postures found, each continued as far as it goes, shape (n, joints), NaN elsewhere."""
    # A fixed seed: the same targets must give the same path.
    joints, rng = search.model.joints, np.random.default_rng(0)
    rows = np.flatnonzero(np.isfinite(postures).all(axis=1))
    collection = [postures]
    yield from _turned(joints, postures)
    predecessors = rows[np.searchsorted(rows, jumps) - 1]
    starts = [(int(row), postures[row]) for row in (*jumps, *predecessors)]
    for row in rows[np.linspace(0, len(rows) - 1, ANCHORS).astype(int)]:
        aim(int(row))
        settled = (search.settle(search.drawn(rng))[0] for _ in range(STARTS))
        starts += [(int(row), values) for values in settled if is_reached(values)]
    for row, values in starts:
        # A posture that another track holds over this row's neighbours too is not continued again.
        around = [r for r in (row - 1, row, row + 1) if 0 <= r < len(postures)]
        if any(
            np.isfinite(track[around]).all()
            and np.abs(_difference(joints, track[row], values)).max() < ALIKE
            and not len(np.intersect1d(around, jumps))
            for track in collection
        ):
            continue
        track = np.full_like(postures, np.nan)
        track[row] = values
        for way in (range(row + 1, len(postures)), range(row - 1, -1, -1)):
            _continue(search, aim, is_reached, track, values, way)
        collection.append(track)
        yield from _turned(joints, track)


def _continue(
    search: KinematicSearch,
    aim: Callable[[int], None],
    is_reached: Callable[[np.ndarray], bool],
    track: np.ndarray,
    values: np.ndarray,
    way: range,
) -> None:
    missed = 0
    for row in way:
        aim(row)
        values, _ = search.settle(values)
        if is_reached(values):
            track[row], missed = values, 0
        elif (missed := missed + 1) > MISSES:
            return


def _turned(joints: tuple[Joint, ...], track: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a track, and the same with each joint of more than one turn a turn further, within its limits."""
    yield track
    for k, joint in enumerate(joints):
        if joint.unit != "rad" or joint.lower is None or joint.upper is None or joint.upper - joint.lower < 2 * np.pi:
            continue
        for turn in (-2 * np.pi, 2 * np.pi):
            variant = track.copy()
            variant[:, k] += turn
            variant[(variant[:, k] < joint.lower) | (variant[:, k] > joint.upper)] = np.nan
            if np.isfinite(variant).any():
                yield variant


def _longest_chain(joints: tuple[Joint, ...], tracks: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Return the longest chain of rows that the joints can follow; ``tracks`` has shape (n, tracks, joints)."""
    count, width = tracks.shape[:2]
    mask, limits = np.asarray(np.isfinite(tracks).all(axis=2)), _limits(joints)
    score, predecessor = np.where(mask, 1.0, -np.inf), np.full((count, width), -1)
    for row in range(1, count):
        first = max(row - WINDOW, 0)
        reach = limits * (seconds[row] - seconds[first:row])[:, None, None]
        reach[:-1] *= CALM
        for k in np.flatnonzero(mask[row]):
            share = np.abs(_difference(joints, tracks[row, k], tracks[first:row])) / reach
            worth = np.where((share <= 1).all(axis=2), score[first:row] + 1 - COST * share.mean(axis=2), -np.inf)
            best = int(np.argmax(worth))
            if worth.flat[best] > score[row, k]:
                score[row, k], predecessor[row, k] = worth.flat[best], first * width + best
    chain = np.full((count, len(joints)), np.nan)
    at = int(np.argmax(score))
    while at >= 0:
        row, k = divmod(at, width)
        chain[row] = tracks[row, k]
        at = int(predecessor[row, k])
    return chain


def _nearest_turns(joints: tuple[Joint, ...], values: np.ndarray, home: np.ndarray) -> np.ndarray:
    """Return the same path with joints without limits at the turn nearest to home at first, then to the row before."""
    result, last = values.copy(), home
    for row in np.flatnonzero(np.isfinite(values).all(axis=1)):
        result[row] = last = last + _difference(joints, values[row], last)
    return result
