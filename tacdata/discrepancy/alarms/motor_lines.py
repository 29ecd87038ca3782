"""Lines in the spectrum while the path moves, and not at rest: noise of a motor's drive.

Periodograms of a whole session are summed over channels, whatever their phases. Without a line the sum is a gamma
variable. Its level is estimated around the line, its shape from quartiles. So channels that share noise make no lines.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import gamma

from tacdata.chain import Course
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.plain_number import plain_number

CHANCE = 1e-4
"""Probability that noise makes one of all lines as large [1]."""
STANDS = 0.01
"""A line at rest, too, is hum: it is distinguished by idle readings [the same]."""
BESIDE = 1.0
"""A line so near counts [Hz]; also the width over which the level is estimated."""
LOWEST = 1.0
"""Lowest line [Hz]: slower variation comes from presses."""
WINDOW = 512.0
"""A session is cut in windows of this length [s]: motors keep no beat for hours."""
FINER = 4
"""Bins of time to an interval of readings."""
FEWEST_ROWS = 200
"""Rows of a window, at least."""
MOVES = 1e-3
"""A path moves from this share of its usual largest speed on [1]."""
OUTLIER = 4.0
"""Larger values are cut down [noise scales]."""
EVEN = 0.05
"""Presses that come as evenly as that make lines of their own [share of their interval]."""
MOST_NAMED = 4


def motor_lines(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of a line that is there only while the path moves, or none."""
    course = cleaned.course
    inside = ~course.first
    if not inside.any() or _even(cleaned):
        return []
    interval, moving = float(np.median(course.step[inside])), _moving(course)
    motion, standstill = _periodogram(cleaned, moving, interval), _periodogram(cleaned, ~moving, interval)
    if motion is None or standstill is None:
        return []
    frequency, power, values = motion
    chance = _chance(frequency, power)
    best = int(np.argmin(chance))
    near = np.abs(frequency - frequency[best]) < BESIDE
    if chance[best] > CHANCE or _chance(frequency, standstill[1])[near].min() < STANDS:
        return []
    # Power of a channel's line over its sum of squares, n a^2 / 4 over n.
    share = np.maximum(power[:, best] - 1.0, 0.0) / values
    decay = np.abs(1 - cleaned.noise.memory * np.exp(-2j * np.pi * frequency[best] * interval))
    size = 2 * np.sqrt(share) * cleaned.noise.scale / max(float(decay), 1e-3)
    order = np.argsort(-size)[:MOST_NAMED]
    names = ", ".join(cleaned.problem.setting.course.channel_names[c] for c in order)
    peak = float(size[order[0]])
    share = plain_number(100 * peak / cleaned.largest, 2)
    large = f"by up to about {plain_number(peak, 2)}, {share} % of the largest rise"
    return [
        Alarm(
            f"while the path moves, and not while it stands, readings swing at {frequency[best]:.3g} "
            "Hz, or an alias of "
            f"it, {large}; most on {names}: a motor's drive is heard",
            "move the rig beside the skin, in the air, with motors on and off; look at the ground "
            "and at cables near them",
        )
    ]


def hums(cleaned: Cleaned) -> bool:
    """Return whether readings have a line while the path rests: channels hum together, each with its own phase."""
    course = cleaned.course
    inside = ~course.first
    if not inside.any():
        return False
    stood = _periodogram(cleaned, ~_moving(course), float(np.median(course.step[inside])))
    return stood is not None and bool(_chance(stood[0], stood[1]).min() < STANDS)


def _moving(course: Course) -> np.ndarray:
    """Return rows where the path moves, shape (m,), bool."""
    speed = np.linalg.norm(np.diff(course.tip, axis=0, prepend=course.tip[:1]), axis=1) / np.maximum(course.step, 1e-9)
    speed[course.first] = 0.0
    return speed > MOVES * np.quantile(speed, 0.95)


def _even(cleaned: Cleaned) -> bool:
    """Return whether presses come so evenly that whatever they share has lines."""
    intervals = np.diff(cleaned.course.time[cleaned.begins])
    return len(intervals) < 2 or float(np.std(intervals)) < EVEN * float(np.mean(intervals))


def _periodogram(
    cleaned: Cleaned, rows: np.ndarray, interval: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return frequencies [Hz], periodograms (channels, frequencies) about 1, and values of a channel; None if few."""
    course = cleaned.course
    bins = int(2 ** np.ceil(np.log2(WINDOW * FINER / interval)))
    power, count, number = np.zeros((cleaned.residual.shape[1], bins // (2 * FINER))), 0, 0
    for window in _windows(cleaned):
        indices = window[rows[window]]
        if len(indices) < FEWEST_ROWS:
            continue
        press = course.episode[indices] - course.episode[indices[0]]
        size = np.maximum(np.bincount(press), 1)
        values = cleaned.residual[indices]
        mean = np.stack([np.bincount(press, each) for each in values.T], axis=1) / size[:, None]
        values = np.clip(values - mean[press], -OUTLIER, OUTLIER)
        at = np.round((course.time[indices] - course.time[indices[0]]) * FINER / interval).astype(int)
        grid = np.zeros((values.shape[1], bins), dtype=np.float32)
        grid[:, np.minimum(at, bins - 1)] = values.T
        # Up to half the rate of readings: the finer grid only keeps the phase of uneven times, beyond are aliases.
        spectrum = np.fft.rfft(grid, axis=1)[:, : bins // (2 * FINER)]
        squares = np.maximum(np.square(values).sum(axis=0), 1e-9)
        power = power + np.square(np.abs(spectrum)) / squares[:, None]
        count, number = count + 1, number + len(indices)
    if not count:
        return None
    frequency = np.fft.rfftfreq(bins, interval / FINER)[: bins // (2 * FINER)]
    return frequency, power / count, np.full(cleaned.residual.shape[1], number / count)


def _windows(cleaned: Cleaned) -> list[np.ndarray]:
    """Return the rows of each window of a session: whole presses."""
    course, result, first = cleaned.course, [], 0
    edges = [*cleaned.begins, len(course.time)]
    session = course.session[cleaned.episodes]
    for k in range(1, len(edges)):
        new = k == len(edges) - 1 or session[k] != session[k - 1]
        if new or course.time[edges[k + 1] - 1] - course.time[edges[first]] > WINDOW:
            result.append(np.arange(edges[first], edges[k]))
            first = k
    return result


def _chance(frequency: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Return of each frequency how many of all lines noise alone makes as large [1]."""
    total = power.sum(axis=0)
    band = (frequency / BESIDE).astype(int)
    level = np.array([np.median(total[band == k]) for k in range(band.max() + 1)])
    ratio = total / np.maximum(np.interp(frequency / BESIDE, np.arange(len(level)) + 0.5, level), 1e-12)
    counted = frequency > LOWEST
    low, high = np.quantile(ratio[counted], [0.25, 0.75])
    # The quartiles are 1.349 standard deviations apart, and the shape of a gamma variable is (mean / deviation)^2.
    shape = (1.349 / max(float(high - low), 1e-6)) ** 2
    return np.where(counted, gamma.sf(ratio * gamma.median(shape), shape) * counted.sum(), 1.0)
