"""Health of each channel in one recording: stuck, saturated, undefined, coupled to another, jumping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.recording.check.idle import idle_rows
from tacdata.recording.episode import PHASES, Episode

RUN = 12
"""Identical readings in a row that a live, noisy channel does not produce [frames]."""
LIVE = 0.3
"""Noise above which the channels of a board count as live [counts]."""
EDGE = 2
"""Frames ignored at both ends of a still stretch, because its bounds are estimates [frames]."""
JUMP = 10.0
"""Minimum jump: change between neighbouring frames of a still stretch [times the noise]."""
JUMP_SHARE = 0.05
"""Minimum jump as a share of the channel's answer to the press [1]; relaxation stays below it."""
ALONE_SHARE = 0.02
"""... and without the common change of all channels at that moment, in ratios of answers, as by relaxation [1]."""
ANSWERING, TOGETHER = 20.0, 4
"""Answer from which a channel counts in the common change [times the noise], and how many must [count]."""
SPIKE, SPIKE_AROUND = 15.0, 5
"""Distance of a spike from the median around it [times the noise], and the frames of that median [count]."""
SLOWER = 0.1
"""Share of equal frames from which a board renews its readings less often than it sends them [1]."""
LASTS = 3
"""Frames before and after over which a jump must last; a spike is no jump."""


@dataclass(frozen=True)
class Jump:
    """A sudden, lasting change of a reading while nothing moves."""

    channel: int
    time_ns: int
    """When [ns]."""
    size: float
    """By how much [counts]."""


def in_phase(episode: Episode, name: str) -> np.ndarray:
    """Return the readings of a phase [counts], shape (n, taxels); for rest also where no phase is marked."""
    if name == "rest":
        return episode.taxels.counts[idle_rows(episode)]
    return episode.taxels.counts[episode.phase_at(episode.taxels.sample_ns) == PHASES.index(name)]


def idle_noise(episode: Episode) -> np.ndarray:
    """Return each channel's noise without contact [counts], shape (taxels,); NaN with fewer than 5 frames of rest.

    The standard deviation of neighbouring differences over sqrt(2), so that slow drift does not enter. It is taken from
    the interquartile range / 1.349, so that a single jump does not enter either.
    """
    idle = in_phase(episode, "rest")
    if len(idle) < 5:
        return np.full(episode.taxels.counts.shape[1], np.nan)
    changes = np.diff(idle, axis=0)
    spread, quartiles = changes.std(axis=0), np.percentile(changes, [25, 75], axis=0)
    # A Gaussian's quartiles are 1.349 standard deviations apart. Quartiles ignore single spikes.
    middle = (quartiles[1] - quartiles[0]) / 1.349
    # Quantised readings have quartiles of whole counts; the plain standard deviation is right for them.
    return np.where(spread > 3 * np.maximum(middle, 1.0), middle, spread) / np.sqrt(2)


def undefined_channels(counts: np.ndarray) -> list[int]:
    """Return the channels with readings that are not finite; ``counts`` has shape (n, taxels)."""
    return np.flatnonzero(~np.isfinite(counts).all(axis=0)).tolist()


def tied_channels(counts: np.ndarray) -> list[list[int]]:
    """Return the pairs of live channels whose readings are identical throughout."""
    pairs, count = [], counts.shape[1]
    if len(counts) < RUN:
        return pairs
    live = [k for k in range(count) if np.isfinite(counts[:, k]).all() and np.ptp(counts[:, k]) > 0]
    owners: dict[bytes, int] = {}
    for channel in live:
        first = owners.setdefault(counts[:, channel].tobytes(), channel)
        if first != channel:
            pairs.append([first, channel])
    return pairs


def frozen_channels(counts: np.ndarray, noise: np.ndarray, limits: tuple[float, float]) -> tuple[list[int], list[int]]:
    """Return the channels that are stuck, and those that are saturated, among otherwise noisy ones.

    A run of identical readings that a live channel does not produce is saturation if it is the channel's extreme and
    the channel moves elsewhere. Otherwise the channel is stuck. A board whose channels are all quiet (under `LIVE`
    counts of noise) proves nothing. A reading that the wire cannot exceed always counts as saturated.

    Args:
        counts: Readings [counts], shape (n, taxels).
        noise: Noise of each channel [counts], shape (taxels,).
        limits: Least and greatest reading that the frame format can hold [counts].
    """
    stuck, saturated = [], []
    constant = (counts == counts[:1]).all(axis=0) if len(counts) else np.ones(counts.shape[1], bool)
    moving = noise[~constant]
    # A board whose channels are all quiet to the count shows constant values in health.
    live = bool(len(moving)) and not np.isnan(moving).all() and np.nanmedian(moving) > LIVE
    for channel in range(counts.shape[1]):
        values = counts[:, channel]
        if len(values) < RUN or (constant[channel] and (constant.all() or not live)):
            continue
        at_limit = int(((values <= limits[0]) | (values >= limits[1])).sum())
        if constant[channel]:
            stuck.append(channel)
        elif at_limit > 1:
            saturated.append(channel)
        elif live:
            length, value = _longest_run(values)
            if length >= RUN:
                (saturated if value in (values.max(), values.min()) else stuck).append(channel)
    return stuck, saturated


def reading_limits(board: dict[str, Any]) -> tuple[float, float]:
    """Return the least and greatest reading that a board's frame format can hold [counts]."""
    kind = str(board.get("format", {}).get("channels", {}).get("type", ""))
    sign, _, bits = kind.partition("int")
    if not bits.isdigit():
        return -np.inf, np.inf
    levels = 2 ** int(bits)
    return (0.0, levels - 1.0) if sign == "u" else (-levels / 2, levels / 2 - 1.0)


def _longest_run(values: np.ndarray) -> tuple[int, float]:
    edges = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1], [True]]))
    lengths = np.diff(edges)
    at = int(np.argmax(lengths))
    return int(lengths[at]), float(values[edges[at]])


def jumps(episode: Episode, noise: np.ndarray, response: np.ndarray) -> list[Jump]:
    """Return the largest jump of each channel that has one.

    Args:
        episode: The recording.
        noise: Noise of each channel [counts], shape (taxels,).
        response: Change of each channel from rest to hold [counts], shape (taxels,).
    """
    usual, size_of = _usual(noise), np.abs(np.nan_to_num(response))
    # A difference of two readings has sqrt(2) times the noise of one.
    threshold = JUMP * np.sqrt(2) * usual
    clear = np.flatnonzero(size_of > ANSWERING * usual)  # none where a reading is no number
    largest: dict[int, Jump] = {}
    phase = episode.phase_at(episode.taxels.sample_ns)
    for name in ("rest", "hold"):
        rows = np.flatnonzero(phase == PHASES.index(name))[EDGE : -EDGE or None]
        if len(rows) < 2 * LASTS + 2:
            continue
        counts = episode.taxels.counts[rows]
        sudden = _lasting(counts, np.maximum(threshold, JUMP_SHARE * size_of))
        if len(clear) >= TOGETHER and np.isfinite(counts).all():
            together, error = _together((counts - counts[0])[:, clear], response[clear], usual[clear])
            channel_threshold = JUMP * np.sqrt(2) * np.hypot(usual, error * size_of)
            sudden += _lasting(
                counts - together[:, None] * response, np.maximum(channel_threshold, ALONE_SHARE * size_of)
            )
        for channel, place, size in sudden:
            jump = Jump(channel, int(episode.taxels.sample_ns[rows[place]]), size)
            if channel not in largest or abs(size) > abs(largest[channel].size):
                largest[channel] = jump
    return [largest[channel] for channel in sorted(largest)]


def _together(change: np.ndarray, response: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the share of their answers by which all channels change [1], shape (n,), and its standard error [1].

    A median of the channels' ratios, weighted by the precision of each: a channel of small answer carries little
    information on a large one. None has more than half the weight of all others, so that its own jump is not taken for
    everybody's.

    Args:
        change: Readings of clear channels less their first [counts], shape (n, m).
        response: Answers of these channels [counts], shape (m,).
        noise: Noise of these channels [counts], shape (m,).
    """
    ratio, precision = change / response, np.abs(response) / noise
    # No channel weighs more than the others together, as the jump of one must not count as common to all.
    weight = np.minimum(precision, (precision.sum() - precision) / 2)
    order = np.argsort(ratio, axis=1)
    middle = (np.cumsum(weight[order], axis=1) < weight.sum() / 2).sum(axis=1)[:, None]
    common = np.take_along_axis(np.take_along_axis(ratio, order, axis=1), middle, axis=1)[:, 0]
    # A weighted median of Gaussian ratios, for many channels; each ratio errs by the inverse of its precision.
    error = np.sqrt(np.pi / 2 * (weight**2).sum()) / (weight * precision).sum()
    return common, float(error)


def _usual(noise: np.ndarray) -> np.ndarray:
    """Return the noise to compare with [counts]: a second of rest may show too little of one channel's by chance."""
    typical = float(np.nanmedian(noise)) if np.isfinite(noise).any() else 0.0
    return np.maximum(np.nan_to_num(noise, nan=np.inf), max(typical / 2, 0.5))


def spikes(episode: Episode, noise: np.ndarray, response: np.ndarray) -> list[Jump]:
    """Return the largest spike of each channel that has one: a reading or two far off those around it, while still.

    Args:
        episode: The recording.
        noise: Noise of each channel [counts], shape (taxels,).
        response: Change of each channel from rest to hold [counts], shape (taxels,).
    """
    threshold = SPIKE * _usual(noise)
    threshold = np.maximum(threshold, JUMP_SHARE * np.abs(np.nan_to_num(response)))
    largest: dict[int, Jump] = {}
    phase = episode.phase_at(episode.taxels.sample_ns)
    for name in ("rest", "hold"):
        rows = np.flatnonzero(phase == PHASES.index(name))[EDGE : -EDGE or None]
        if len(rows) < SPIKE_AROUND:
            continue
        counts = episode.taxels.counts[rows]
        padded = np.pad(counts, ((SPIKE_AROUND // 2, SPIKE_AROUND // 2), (0, 0)), mode="edge")
        around = np.median(np.lib.stride_tricks.sliding_window_view(padded, SPIKE_AROUND, axis=0), axis=-1)
        for place, channel in np.argwhere(np.abs(counts - around) > threshold).tolist():
            size = float(counts[place, channel] - around[place, channel])
            if channel not in largest or abs(size) > abs(largest[channel].size):
                largest[channel] = Jump(channel, int(episode.taxels.sample_ns[rows[place]]), size)
    return [largest[channel] for channel in sorted(largest)]


def held_frames(counts: np.ndarray, noise: np.ndarray) -> int:
    """Return the most frames in a row in which no channel changes [count]; 0 for a board that is quiet or dead.

    Args:
        counts: Readings [counts], shape (n, taxels).
        noise: Noise of each channel [counts], shape (taxels,).
    """
    if len(counts) < 2 or np.isnan(noise).all() or np.nanmedian(noise) <= LIVE or (counts == counts[:1]).all():
        return 0
    same = np.concatenate([[False], (counts[1:] == counts[:-1]).all(axis=1), [False]])
    # k equal neighbours in a row are k + 1 equal frames.
    edges = np.flatnonzero(np.diff(same.astype(int)))
    return int((edges[1::2] - edges[::2]).max(initial=0)) + 1 if len(edges) else 0


def held_by_chance(counts: np.ndarray, idle: np.ndarray, frames: int) -> float:
    """Return how many runs of so many equal ``frames`` noise alone leaves in a recording [count].

    Channels whose noise is common count as fewer. A board that renews its readings less often than it sends frames
    has equal ones throughout; it gets no judgement (infinity).

    Args:
        counts: Readings [counts], shape (n, taxels).
        idle: Those without contact [counts], shape (m, taxels).
        frames: Length of the run [count].
    """
    change = np.diff(idle, axis=0)
    change = change[:, change.any(axis=0)]
    # A board slower than its recording repeats frames by design.
    repeats = np.mean((counts[1:] == counts[:-1]).all(axis=1))
    if len(change) < RUN or change.shape[1] < 2 or repeats > SLOWER:
        return np.inf
    resolution = np.abs(change[change != 0]).min()
    # Two Gaussian readings are equal with this probability; their difference has twice the variance of one.
    equal = np.minimum(resolution / (np.sqrt(2 * np.pi) * change.std(axis=0)), 1.0)
    # Effective number of independent channels: (sum of eigenvalues)^2 / sum of their squares, of the correlation
    # matrix.
    independent = change.shape[1] ** 2 / (np.corrcoef(change.T) ** 2).sum()
    return len(counts) * float(np.exp(independent * np.log(equal).mean() * (frames - 1)))


def _lasting(counts: np.ndarray, threshold: np.ndarray) -> list[tuple[int, int, float]]:
    change = np.diff(counts, axis=0)
    # Relaxation changes all neighbouring differences equally: their running median is subtracted.
    padded = np.pad(change, ((2, 2), (0, 0)), mode="edge")
    trend = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0), axis=-1)
    sudden = np.argwhere(np.abs(change - trend) > threshold)
    shifts = []
    for place, channel in sudden:
        if not LASTS <= place + 1 <= len(counts) - LASTS:
            continue
        # A spike returns; a jump stays. Medians on both sides keep the two apart.
        baseline = np.median(counts[place + 1 - LASTS : place + 1, channel])
        size = float(np.median(counts[place + 1 : place + 1 + LASTS, channel]) - baseline)
        if abs(size) > 0.6 * threshold[channel]:
            shifts.append((int(channel), int(place) + 1, size))
    return shifts
