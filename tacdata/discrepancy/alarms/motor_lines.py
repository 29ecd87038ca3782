"""Lines in the spectrum: hum while the path stands; noise of a motor's drive while it moves, and not at rest.

Periodograms of a whole session are summed over channels, whatever their phases. Without a line the sum is a gamma
variable. Its level is estimated around the line, its shape from quartiles. So channels that share noise make no lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import gamma

from tacdata.chain import Course
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.randomization import rarest
from tacdata.discrepancy.plain_number import plain_number

STANDS = 0.01
"""A line is there at rest, too, if noise makes one of all lines as large with this probability [1]."""
LEAST = 0.003
"""A smaller line at rest, over the largest rise of the readings, is left alone [1]."""
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
    if _even(cleaned):
        return []
    motion, standstill = _periodogram(cleaned, _moving(course)), _periodogram(cleaned, ~_moving(course))
    if motion is None or standstill is None:
        return []
    best = rarest(motion.tails)
    # The line must be absent at rest, in neighbouring bins too: a rate that differs a little moves it by one.
    near = np.abs(motion.frequency - motion.frequency[best.at]) < BESIDE
    if not best.alarms or standstill.tails[near].min() * np.count_nonzero(standstill.counted) < STANDS:
        return []
    hertz, large = _told(cleaned, motion, best.at)
    return [
        Alarm(
            f"readings swing at {hertz}, while the path moves and not while it stands: a motor's drive is heard; "
            f"{large}",
            "move the rig beside the skin, in the air, with motors on and off; look at the ground "
            "and at cables near them",
        )
    ]


def hum(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of a line while the path stands, or none."""
    standstill = None if _even(cleaned) else _periodogram(cleaned, ~_moving(cleaned.course))
    if standstill is None:
        return []
    best = rarest(standstill.tails)
    if not best.alarms or _size(cleaned, standstill, best.at).max() < LEAST * cleaned.largest:
        return []
    hertz, large = _told(cleaned, standstill, best.at)
    return [
        Alarm(
            f"readings swing at {hertz}, while the path stands: hum of the mains, or a beat with it; {large}",
            "record without contact with motors and lamps off and on; look at the ground and at the cables' shields",
        )
    ]


def hums(cleaned: Cleaned) -> bool:
    """Return whether readings have a line while the path rests: channels hum together, each with its own phase."""
    standstill = _periodogram(cleaned, ~_moving(cleaned.course))
    return standstill is not None and rarest(standstill.tails).p < STANDS


@dataclass(frozen=True)
class _Lines:
    """Periodograms of a session."""

    frequency: np.ndarray
    """[Hz], shape (frequencies,)."""
    power: np.ndarray
    """About 1 for noise [1], shape (channels, frequencies)."""
    values: float
    """Readings of a channel in a window."""
    interval: float
    """Interval of readings [s]."""

    @property
    def counted(self) -> np.ndarray:
        """Frequencies that may be a line, shape (frequencies,), bool."""
        return self.frequency > LOWEST

    @cached_property
    def tails(self) -> np.ndarray:
        """Probability that noise alone makes a line as large [1], shape (frequencies,); 1 where none is counted."""
        total = self.power.sum(axis=0)
        band = (self.frequency / BESIDE).astype(int)
        level = np.array([np.median(total[band == k]) for k in range(band.max() + 1)])
        # Noise has a slope over frequency. A line is judged by the level around it.
        middle = np.interp(self.frequency / BESIDE, np.arange(len(level)) + 0.5, level)
        ratio = total / np.maximum(middle, 1e-12)
        low, high = np.quantile(ratio[self.counted], [0.25, 0.75])
        # The quartiles are 1.349 standard deviations apart; the shape of a gamma variable is (mean / deviation)^2.
        shape = (1.349 / max(float(high - low), 1e-6)) ** 2
        return np.where(self.counted, gamma.sf(ratio * gamma.median(shape), shape), 1.0)


def _size(cleaned: Cleaned, lines: _Lines, at: int) -> np.ndarray:
    """Return each channel's amplitude of a line [its unit], shape (channels,)."""
    # Power of a channel's line over its sum of squares, n a^2 / 4 over n.
    share = np.maximum(lines.power[:, at] - 1.0, 0.0) / lines.values
    decay = np.abs(1 - cleaned.noise.memory * np.exp(-2j * np.pi * lines.frequency[at] * lines.interval))
    return 2 * np.sqrt(share) * cleaned.noise.scale / max(float(decay), 1e-3)


def _told(cleaned: Cleaned, lines: _Lines, at: int) -> tuple[str, str]:
    """Return a line's frequency, and its size with its channels, in words."""
    size = _size(cleaned, lines, at)
    order = np.argsort(-size)[:MOST_NAMED]
    names = ", ".join(cleaned.problem.setting.course.channel_names[c] for c in order)
    share = plain_number(100 * float(size[order[0]]) / cleaned.largest, 2)
    peak = plain_number(float(size[order[0]]), 2)
    large = f"the largest swing is about {peak} in readings, {share} % of the largest rise"
    return f"{lines.frequency[at]:.3g} Hz or an alias of it", f"{large}, on {names}"


def _moving(course: Course) -> np.ndarray:
    """Return rows where the path moves, shape (m,), bool."""
    speed = np.linalg.norm(np.diff(course.tip, axis=0, prepend=course.tip[:1]), axis=1) / np.maximum(course.step, 1e-9)
    speed[course.first] = 0.0
    return speed > MOVES * np.quantile(speed, 0.95)


def _even(cleaned: Cleaned) -> bool:
    """Return whether presses come so evenly that whatever they share has lines."""
    intervals = np.diff(cleaned.course.time[cleaned.begins])
    return len(intervals) < 2 or float(np.std(intervals)) < EVEN * float(np.mean(intervals))


def _periodogram(cleaned: Cleaned, rows: np.ndarray) -> _Lines | None:
    """Return the lines of some rows, shape (m,), bool; None if they are few."""
    course = cleaned.course
    if course.first.all():
        return None
    interval = float(np.median(course.step[~course.first]))
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
        # One spike has power at each frequency.
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
    return _Lines(frequency, power / count, number / count, interval)


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
