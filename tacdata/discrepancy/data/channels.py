"""Which channels can be used, which are clipped or hold codes, and their names in the source."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tacdata.errors import FormatError
from tacdata.recording.files.reader import Recording

MOST_MISSING = 0.3
"""A channel that lacks a larger share of its readings is left out [1]."""
DEEPER = 0.01
"""Clipping: the tip goes on deeper by this share of the stroke..."""
FEWEST_STOPPED = 3
"""...over so many readings, at least."""
FLAT_Z = 12.0
"""Clipping: a reading that stops changed by so many noises, or steps, over as much depth before [1]."""
FEWEST_STOPS = 2
"""Clipping: a channel is clipped if it stops so often..."""
MANY_STOPPED = 10
"""...or over so many readings."""
FAR = 1e6
"""A reading is an instrument's code from so many times the range of the inner readings on [1]."""
INNER = (0.05, 0.95)
"""Quantiles between which readings are inner ones [1]."""
STILL = 1e-3
"""Range of a channel that hardly moves, at least [its size]."""
MOST_NAMES = 64
"""Names of more channels are not listed."""


@dataclass(frozen=True)
class Readings:
    """One recording."""

    counts: np.ndarray
    """In the order of time [the source's unit], shape (n, channels); NaN where missing."""
    depth: np.ndarray
    """Of the tip at those times [mm], shape (n,); NaN where nobody knows."""


def readings(recording: Recording) -> Readings:
    """Return a recording's readings, and the depth of the tip."""
    episode = recording.episode
    order = np.argsort(episode.taxels.sample_ns, kind="stable")
    time_ns = episode.taxels.sample_ns[order]
    depth = episode.tip_at(time_ns)[:, 2] if len(episode.tip_ns) else np.full(len(order), np.nan)
    return Readings(episode.taxels.counts[order], depth)


def usable(recorded: Sequence[Readings]) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return which channels can be used, the limits at which they are clipped, and remarks as sentences.

    Returns:
        Channels, shape (k,), int64; the least and the largest reading of each, -inf and inf where it is not clipped
        [the source's unit], shape (2, k); why others cannot be used, and which are clipped.

    Raises:
        FormatError: If none can.
    """
    notes, numbers, counts = [], [], np.concatenate([r.counts for r in recorded])
    still = np.all([np.fmax.reduce(r.counts) == np.fmin.reduce(r.counts) for r in recorded if len(r.counts)], axis=0)
    for channel, values in enumerate(counts.T):
        good = values[np.isfinite(values)]
        if len(good) < (1 - MOST_MISSING) * len(values):
            notes.append(f"channel {channel}: {100 * (1 - len(good) / len(values)):.0f} % missing, left out")
        elif len(good) == 0 or np.ptp(good) == 0:
            notes.append(f"channel {channel}: always {good[0] if len(good) else 'nothing'}, stuck or dead, left out")
        elif still[channel]:
            notes.append(f"channel {channel}: one reading throughout each recording, stuck or dead, left out")
        else:
            numbers.append(channel)
    if not numbers:
        raise FormatError(
            f"no channel with usable readings ({'; '.join(notes[:3])})",
            "at least one that changes",
            "mend the board, or name other columns in the import's mapping, and record or import again",
        )
    limits, words = _clipped(recorded, numbers)
    return np.array(numbers), limits, notes + words


def _clipped(recorded: Sequence[Readings], channels: list[int]) -> tuple[np.ndarray, list[str]]:
    """Return where channels stop at their largest or smallest reading while the tip goes on deeper, as in `usable`."""
    words, limits = [], np.repeat([[-np.inf], [np.inf]], len(channels), axis=1)
    for side, name, extreme in ((1, "largest", np.nanmax), (0, "smallest", np.nanmin)):
        entries = []
        for at, channel in enumerate(channels):
            values = np.concatenate([r.counts[:, channel] for r in recorded])
            limit = float(extreme(values))
            steps = np.diff(np.unique(values[np.isfinite(values)]))
            runs = [run for r in recorded for run in _stops(r.counts[:, channel], r.depth, limit, float(steps.min()))]
            if len(runs) >= FEWEST_STOPS or sum(runs) >= MANY_STOPPED:
                limits[side, at] = limit
                entries.append(f"channel {channel} at {limit:g} ({100 * np.mean(values == limit):.2g} %)")
        if entries:
            words.append(
                f"clipped at the {name} reading (share of its readings): {', '.join(entries)}; it stays while the tip "
                "goes on deeper, so these are left out: press less deep, or give it a wider range"
            )
    return limits, words


def _stops(values: np.ndarray, depth: np.ndarray, limit: float, step: float) -> list[int]:
    """Return how many readings each stop at a limit holds; holds of the tip, play and late readings are none.

    Args:
        values: Of one channel in one recording, shape (n,).
        depth: Of the tip [mm], shape (n,).
        limit: The reading at which it may stop.
        step: Smallest difference of two readings.
    """
    valid = np.isfinite(values) & np.isfinite(depth)
    values, depth = values[valid], depth[valid]
    if len(values) < FEWEST_STOPPED:
        return []
    # A second difference of white noise has 6 times its variance, and a press hardly contributes to it.
    noise = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], values == limit, [False]]).astype(int)))
    words = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        on = float(depth[begin:end].max() - depth[begin])
        if begin == 0 or end - begin < FEWEST_STOPPED or on < DEEPER * float(np.ptp(depth)):
            continue
        # Just as far before the stop: by as much as there, the reading should have gone on.
        shallower = np.flatnonzero(depth[:begin] <= depth[begin] - on)
        at = int(shallower[-1]) if len(shallower) else int(np.argmin(depth[:begin]))
        way = float(depth[begin] - depth[at])
        if way > 0 and abs(limit - values[at]) * min(on / way, 1.0) > FLAT_Z * max(noise, step):
            words.append(end - begin)
    return words


def without_codes(recordings: Sequence[Recording]) -> tuple[Sequence[Recording], list[str]]:
    """Return recordings with codes as missing values, and remarks on these.

    Args:
        recordings: Of the same channels.
    """
    counts = np.concatenate([r.episode.taxels.counts for r in recordings]).astype(float)
    odd = codes(counts)
    if not odd.any():
        return recordings, []
    result, first = [], 0
    for recording in recordings:
        episode = recording.episode
        last = first + len(episode.taxels.counts)
        readings = np.where(odd[first:last], np.nan, episode.taxels.counts)
        taxels = replace(episode.taxels, counts=readings)
        result.append(replace(recording, episode=replace(episode, taxels=taxels)))
        first = last
    listed = [
        f"channel {k} ({np.count_nonzero(odd[:, k])}, as {counts[odd[:, k], k][0]:.3g})"
        for k in np.flatnonzero(odd.any(axis=0))
    ]
    return result, [f"readings that are an instrument's codes, set aside: {', '.join(listed)}"]


def codes(values: np.ndarray) -> np.ndarray:
    """Return which values are codes, shape (n, channels), bool: far beyond the range of the others.

    Args:
        values: Shape (n, channels); NaN where missing.
    """
    result = np.zeros(values.shape, dtype=bool)
    for k, column in enumerate(values.T):
        finite = np.isfinite(column)
        if not finite.any():
            continue
        low, middle, high = np.quantile(column[finite], [INNER[0], 0.5, INNER[1]])
        # For a channel that hardly moves, its size replaces its range.
        size = max(float(high - low), STILL * abs(float(middle)))
        if 0 < size < np.inf:
            result[finite, k] = np.abs(column[finite] - middle) > FAR * size
    return result


def in_source(recordings: Sequence[Recording], channels: int) -> list[str]:
    """Return in words which columns of the source the channels are; nothing where names say no more than numbers."""
    name_sets = {tuple(recording.board.get("names", ()))[:channels] for recording in recordings}
    names = list(next(iter(name_sets))) if len(name_sets) == 1 else []
    parts = [re.fullmatch(r"(.*?)(\d+)\]?", name) for name in names]
    if len(names) != channels or all(p and int(p[2]) == k for k, p in enumerate(parts)):
        return []
    if len({(p[1], int(p[2]) - k) for k, p in enumerate(parts) if p}) == 1 and all(parts) and channels > 2:
        return [f"channels 0 to {channels - 1} are the source's {names[0]} to {names[-1]}, in this order"]
    listed = ", ".join(f"{k} {name}" for k, name in enumerate(names[:MOST_NAMES]))
    more = ", ..." if channels > MOST_NAMES else ""
    return [f"channels and their names in the source: {listed}{more}"]
