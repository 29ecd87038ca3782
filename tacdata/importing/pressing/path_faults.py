"""Faults of a measured position: dropouts, jumps faster than the machine, and gaps against the channels' clock.

A logger that misses a reading writes 0 or an old value, and a log that stops hides the depth of a press. Both are found
before presses are cut. The readings of the channels decide: a real motion changes them, a dropout does not.
"""

from dataclasses import dataclass, replace

import numpy as np

from tacdata.importing.pressing.held_position import held_rows
from tacdata.importing.streams import ImportedStreams, Stream


@dataclass(frozen=True)
class PathPolicy:
    """Limits of a plausible position. None was tuned on data."""

    longest: int = 3
    """Longest dropout whose value varies [rows]. One whose value is constant may be longer."""
    share: float = 0.1
    """Smallest jump of a dropout [path's range]."""
    faster: float = 5.0
    """Smallest ratio of its steps to those of the path elsewhere [1]."""
    onward: float = 1.5
    """Largest way of the machine during a dropout [its usual way]."""
    unanswered: float = 2.0
    """The same of a jump to which no reading answers, for speeds [1]."""
    rare: float = 0.02
    """Largest share of rows in dropouts [1]. Above it they are taps of the machine."""
    ramps: float = 0.3
    """Smallest share of the way that a machine moves in ramps [1]. Below it the path is a set point, which jumps."""
    answered: float = 0.1
    """Change of the readings from which a motion is real [their range]."""
    noise: float = 5.0
    """The same [noise of the readings]."""
    gap: float = 10.0
    """Shortest gap [usual intervals]."""
    late: float = 2.5
    """Shortest gap of a position with slow updates of its own [their interval]."""
    gap_seconds: float = 0.5
    """Shortest gap [s]."""
    rows: int = 3
    """Fewest rows of the channels in a gap that counts [rows]."""
    still: float = 0.01
    """Largest difference of the ends of a gap in which the machine stood still [path's range]."""


POLICY = PathPolicy()


def without_faults(streams: ImportedStreams, policy: PathPolicy = POLICY) -> ImportedStreams:
    """Return streams without dropouts of the position, and without the channels' rows in its gaps.

    Each fault is counted in the streams' doubts.
    """
    position, taxels = streams.position, streams.taxels
    if position is None or len(position.time_ns) < 10 or len(taxels.time_ns) < 10:
        return streams
    doubts = []
    dropped = _dropouts(position, taxels, policy)
    if dropped.any():
        row = int(np.flatnonzero(dropped)[0])
        doubts.append(
            f"position: {int(dropped.sum())} rows jump faster than the machine moves elsewhere, and the readings do "
            f"not follow, the first at {position.time_ns[row] / 1e9:.6g} s: left out as dropouts (position: "
            "{trusted: true} keeps them)"
        )
        position = position.chosen(np.flatnonzero(~dropped))
    position, taxels, words, update_ns = _without_held(position, taxels)
    doubts += words
    inside, gaps = _in_gaps(position, taxels, update_ns, policy)
    if inside.any():
        doubts.append(
            f"position: it stops {len(gaps)} times while the channels run on, for up to {max(gaps):.3g} s, and the "
            f"depth in between is not known: {int(inside.sum())} rows of the channels there are left out (position: "
            "{trusted: true} keeps them and bridges the gaps)"
        )
        taxels = taxels.chosen(np.flatnonzero(~inside))
    doubts += _jumps(position, taxels, policy)
    return replace(streams, position=position, taxels=taxels, doubts=(*streams.doubts, *doubts))


def _without_held(position: Stream, taxels: Stream) -> tuple[Stream, Stream, list[str], float]:
    """Return a position without old values and the channels without their rows at a stuck position.

    Both come in words as well, with the time between two updates of the position [ns].
    """
    span = _span(position.values)
    stale = held_rows(position, _readings_at(taxels, position.time_ns), span)
    overruled = "(position: {trusted: true} keeps them)"
    keep, inside, doubts = ~stale.repeated, np.zeros(len(taxels.time_ns), dtype=bool), []
    time_ns = position.time_ns
    update_ns = stale.every * float(np.median(np.diff(time_ns)))
    if stale.repeated.any():
        cause = f"a new value comes every {update_ns / 1e9:.3g} s only" if stale.every else "its last value repeats"
        row = int(np.flatnonzero(stale.repeated)[0])
        doubts.append(
            f"position: {cause} while the readings go on: {int(stale.repeated.sum())} old values are left out, the "
            f"first at {time_ns[row] / 1e9:.6g} s {overruled}"
        )
    for first, last in stale.stuck:
        inside |= (taxels.time_ns > time_ns[first]) & (taxels.time_ns < time_ns[last])
        keep[first + 1 : last] = False
    if stale.stuck:
        first, last = stale.stuck[0]
        doubts.append(
            f"position: it stands still while the readings rise and fall, in {len(stale.stuck)} stretches, first from "
            f"{time_ns[first] / 1e9:.6g} s to {time_ns[last] / 1e9:.6g} s: {int(inside.sum())} rows of the channels "
            f"there are left out {overruled}"
        )
    return position.chosen(np.flatnonzero(keep)), taxels.chosen(np.flatnonzero(~inside)), doubts, update_ns


def _span(values: np.ndarray) -> float:
    """Return the range of a path or of readings over all of its columns, without its outermost hundredths."""
    if not len(values):
        return 0.0
    # Dropouts must not set the range by which they are found.
    low, high = np.nanquantile(values, [0.01, 0.99], axis=0)
    return float(np.linalg.norm(np.nan_to_num(high - low)))


def _dropouts(position: Stream, taxels: Stream, policy: PathPolicy) -> np.ndarray:
    """Return which rows of a position are dropouts, shape (rows,), bool."""
    path = position.values
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    span = max(_span(path), 1e-12)
    moving = steps[steps > 1e-9 * span]
    dropped = np.zeros(len(path), dtype=bool)
    if not len(moving):
        return dropped
    usual = float(np.median(moving))
    for begin, end in _excursions(path, steps, span, usual, policy):
        if not dropped[begin:end].any() and not _followed(position, taxels, begin, end, policy):
            dropped[begin:end] = True
    if dropped.mean() > policy.rare and not _in_ramps(steps, dropped, policy):
        dropped[:] = False
    # The first or the last rows, as of a logger that begins with zeros.
    regular = steps[~dropped[1:] & ~dropped[:-1]]
    for rows in range(1, policy.longest + 1):
        for edge, outer in ((rows - 1, slice(0, rows)), (len(steps) - rows, slice(len(path) - rows, len(path)))):
            # The fastest steps are left out: the dropout at the edge is among them and must not excuse itself.
            largest = np.sort(regular)[: -policy.longest]
            fastest = float(largest[-1]) if len(largest) else 0.0
            if steps[edge] > max(policy.share * span, policy.faster * fastest) and fastest > 0:
                dropped[outer] = True
    return dropped


def _excursions(
    path: np.ndarray, steps: np.ndarray, span: float, usual: float, policy: PathPolicy
) -> list[tuple[int, int]]:
    """Return the rows, from one to before another, in which a path is away by jumps and comes back to where it was."""
    sharp = np.flatnonzero(steps > max(policy.share * span, policy.faster * usual))
    excursions = []
    for first, second in zip(sharp.tolist(), sharp[1:].tolist(), strict=False):
        begin, end = first + 1, second + 1
        back = float(np.linalg.norm(path[end] - path[first]))
        constant = bool((path[begin:end] == path[begin]).all())
        jump = min(steps[first], steps[second])
        # During a dropout the machine moves on.
        onward = policy.onward * usual * (end - first)
        if back <= max(jump / policy.faster, onward) and (end - begin <= policy.longest or constant):
            excursions.append((begin, end))
    return excursions


def _in_ramps(steps: np.ndarray, dropped: np.ndarray, policy: PathPolicy) -> bool:
    """Return whether a machine moves in ramps and not in the jumps of a set point."""
    edges = dropped[1:] | dropped[:-1]
    way = steps[~edges]
    slow = way[way <= policy.faster * np.median(way[way > 0])] if (way > 0).any() else way
    return float(slow.sum()) >= policy.ramps * float(steps.sum())


def _followed(position: Stream, taxels: Stream, begin: int, end: int, policy: PathPolicy) -> bool:
    """Return whether the readings follow the path away and back again."""
    times = position.time_ns
    # Without readings there, only a long stay away is taken for a motion.
    if end >= len(times) or times[begin - 1] < taxels.time_ns[0] or times[end] > taxels.time_ns[-1]:
        return end - begin > policy.longest
    head, *inside, tail = _readings_at(taxels, times[begin - 1 : end + 1])
    change = np.linalg.norm(np.nan_to_num(np.median(inside, axis=0) - (head + tail) / 2))
    return bool(change > _least(taxels, policy))


def _answered(position: Stream, taxels: Stream, row: int, policy: PathPolicy) -> bool:
    """Return whether the readings change from a row of the path to the next."""
    ends = position.time_ns[row : row + 2]
    if ends[0] < taxels.time_ns[0] or ends[1] > taxels.time_ns[-1]:
        return True
    before, after = _readings_at(taxels, ends)
    return bool(np.linalg.norm(np.nan_to_num(after - before)) > _least(taxels, policy))


def _least(taxels: Stream, policy: PathPolicy) -> float:
    """Return the smallest change of the readings that is an answer [their unit]."""
    noise = np.nanmedian(np.abs(np.diff(taxels.values, axis=0)), axis=0)
    return max(policy.answered * _span(taxels.values), policy.noise * float(np.linalg.norm(np.nan_to_num(noise))))


def _readings_at(taxels: Stream, time_ns: np.ndarray) -> np.ndarray:
    """Return the readings at times [ns], shape (n, channels); missing ones are interpolated."""
    columns = []
    for column in taxels.values.T:
        valid = np.isfinite(column)
        series = np.interp(time_ns, taxels.time_ns[valid], column[valid]) if valid.any() else np.zeros(len(time_ns))
        columns.append(series)
    return np.stack(columns, axis=1)


def _in_gaps(position: Stream, taxels: Stream, update_ns: float, policy: PathPolicy) -> tuple[np.ndarray, list[float]]:
    """Return which rows of the channels lie in a gap of the position, shape (rows,), bool, and the gaps [s].

    A position with a slow update of its own, every ``update_ns`` [ns], has no gap between two of them.
    """
    inside, gaps = np.zeros(len(taxels.time_ns), dtype=bool), []
    steps = np.diff(position.time_ns)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else np.inf
    span = max(_span(position.values), 1e-12)
    longest = max(policy.gap * usual, policy.gap_seconds * 1e9, policy.late * update_ns)
    for row in np.flatnonzero(steps > longest).tolist():
        first, last = np.searchsorted(taxels.time_ns, [position.time_ns[row] + 1, position.time_ns[row + 1]])
        way = float(np.linalg.norm(position.values[row + 1] - position.values[row]))
        if last - first >= policy.rows and way > policy.still * span:
            inside[first:last] = True
            gaps.append(float(steps[row]) / 1e9)
    return inside, gaps


def _jumps(position: Stream, taxels: Stream, policy: PathPolicy) -> list[str]:
    """Return a doubt about steps that are faster than the machine and do not come back; [] for a set point."""
    spans = np.diff(position.time_ns)
    near = spans <= policy.gap * np.median(spans)
    steps = np.where(near, np.linalg.norm(np.diff(position.values, axis=0), axis=1), 0.0)
    moving = np.sort(steps[steps > 0])
    if len(moving) < 10 or not _in_ramps(steps, np.zeros(len(position.values), dtype=bool), policy):
        return []
    limit = max(policy.share * _span(position.values), policy.faster * float(moving[int(0.95 * len(moving))]))
    speeds = steps / np.maximum(spans, 1)
    usual = float(np.quantile(speeds[steps > 0], 0.95))
    slips = np.flatnonzero((steps > policy.share * _span(position.values)) & (speeds > policy.unanswered * usual))
    slips = [row for row in slips.tolist() if not _answered(position, taxels, row, policy)]
    sharp = np.union1d(np.flatnonzero(steps > limit), slips).astype(int)
    if not len(sharp) or len(sharp) > max(policy.rare * len(steps), 1):
        return []
    row = int(sharp[0])
    seconds = (position.time_ns[row + 1] - position.time_ns[row]) / 1e9
    return [
        f"position: it jumps {len(sharp)} times and does not come back, first by {steps[row]:.4g} mm in {seconds:.3g} "
        f"s at {position.time_ns[row] / 1e9:.6g} s, faster than the machine moves elsewhere: is its zero another then?"
    ]
