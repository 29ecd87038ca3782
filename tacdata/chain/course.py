"""Paths of an indenter and readings of a sensor, over whole sessions: the table that the chain works on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

FORGOTTEN = 1e9
"""Longer than any skin remembers [s]."""
CORNERS = 0.1
"""A smaller share of rows off the straight line between their neighbours are corners of a path, not noise [1]."""
NUDGE = 0.005
"""A little deeper or higher [stroke]: steps of derivatives by depth."""
ALTERNATES = -0.1
"""Noise changes sides from row to row: the signs of the deviations of successive rows correlate by less than this [1].

White noise has -0.46, a random walk -0.33. A commanded path turns twice the same way where it rests between two
moves, and more often in a ramp: it has 0 and more.
"""
MIDDLE = 1.4826
"""Standard deviation over the median absolute deviation [1]."""
BY_ROW = ("time", "episode", "tip", "tool", "readings", "averaged", "force", "tag", "temperature", "clipped")
"""Fields of a course with a value for each row."""


@dataclass(frozen=True)
class Tool:
    """An indenter as far as the chain needs it."""

    name: str
    """The specimen's name."""
    shape: str
    """Its shape: a member of the indenters, or "unknown"."""
    radius: float
    """Radius at the tip [mm]; NaN where it has none or is not known."""


@dataclass(frozen=True)
class Course:
    """Rows in the order of time, one a reading; episodes and sessions one after the other."""

    time: np.ndarray
    """Time since the first row, sessions laid end to end [s], shape (n,), increasing."""
    episode: np.ndarray
    """Episode of each row, from 0, shape (n,), int64, not falling."""
    tip: np.ndarray
    """Commanded x, y and depth below the undeformed outer face [mm], shape (n, 3)."""
    tool: np.ndarray
    """Index into ``tools`` of each row, shape (n,), int64."""
    readings: np.ndarray
    """Un-tared readings [counts or the source's unit], shape (n, channels); NaN where missing."""
    averaged: np.ndarray
    """How many readings each row is the mean of [1], shape (n,); 0 in between, where only the path is known."""
    session: np.ndarray
    """Session of each episode, from 0, shape (episodes,), int64."""
    site: np.ndarray
    """Place that each episode presses, from 0, shape (episodes,), int64."""
    tools: tuple[Tool, ...]
    names: tuple[str, ...]
    """Name of each episode, as a person knows it."""
    centers: np.ndarray | None = None
    """Place of each channel on the sensor [mm], shape (channels, 2); None if they form no known array."""
    force: np.ndarray | None = None
    """Measured normal force, pressing positive [N], shape (n,); NaN where missing."""
    tag: np.ndarray | None = None
    """Tip as a second, independent observation saw it (x, y, depth) [mm], shape (n, 3); NaN where missing."""
    temperature: np.ndarray | None = None
    """Measured temperature [degC], shape (n,)."""
    notes: tuple[str, ...] = ()
    """Remarks on these data for the user."""
    recording: np.ndarray | None = None
    """Recording that each episode is a stroke of, from 0, shape (episodes,), int64; None: each is its own."""
    numbers: tuple[int, ...] = ()
    """Each channel's number in the recordings; empty: none was left out."""
    clipped: np.ndarray | None = None
    """Readings that a channel's range ends at: more would read the same, shape (n, channels), bool; None: none."""
    specimens: tuple[str, ...] = ()
    """Name of each episode's specimen, by the source; empty: it names none."""
    effort: bool | None = None
    """Whether channels are an effort of the drive, as a current, or a response; None: the source says neither."""
    apart: bool = False
    """Whether episodes are so far apart that no memory lasts from one to the next, regardless of the clock."""
    restarts: np.ndarray | None = None
    """Whether a clock of its own begins with an episode: the rest before it is not known and taken as long, shape
    (episodes,), bool; None: one clock."""

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.time)

    @property
    def channels(self) -> int:
        """Number of channels."""
        return self.readings.shape[1]

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Name of each channel, by its number in the recordings."""
        return tuple(f"channel {k}" for k in self.numbers or range(self.channels))

    @property
    def episodes(self) -> int:
        """Number of episodes."""
        return len(self.session)

    @cached_property
    def read(self) -> np.ndarray:
        """Rows at which something was read, shape (m,), int64."""
        return np.flatnonzero(self.averaged > 0)

    @cached_property
    def reduced(self) -> Self:
        """The course with only those rows."""
        rows = self.read
        if len(rows) == self.rows:
            return self
        columns = {name: value[rows] for name in BY_ROW if (value := getattr(self, name)) is not None}
        return replace(self, **columns)

    @cached_property
    def step(self) -> np.ndarray:
        """Time since the row before [s], shape (n,); the first is 0, unless episodes are `apart`."""
        step = np.diff(self.time, prepend=self.time[:1])
        if self.apart:
            return np.where(self.first, FORGOTTEN, step)
        return step if self.restarts is None else np.where(self.first & self.restarts[self.episode], FORGOTTEN, step)

    @cached_property
    def first(self) -> np.ndarray:
        """Whether a row is the first of its episode, shape (n,), bool."""
        return np.diff(self.episode, prepend=-1) != 0

    @cached_property
    def speed(self) -> np.ndarray:
        """Commanded rate of depth, from the row before [mm/s], shape (n,); 0 in first rows."""
        rate = np.diff(self.tip[:, 2], prepend=self.tip[:1, 2]) / np.maximum(self.step, 1e-9)
        return np.where(self.first, 0.0, rate)

    @cached_property
    def clock(self) -> np.ndarray:
        """Time over the time of the last row [1], shape (n,)."""
        return self.time / max(float(self.time[-1]), 1e-9)

    @cached_property
    def warmth(self) -> np.ndarray:
        """Temperature above its mean [10 K], shape (n,); 0 where none was measured."""
        if self.temperature is None:
            return np.zeros(self.rows)
        return np.nan_to_num((self.temperature - np.nanmean(self.temperature)) / 10.0)

    @cached_property
    def dithers(self) -> np.ndarray:
        """Noise of x, y and depth, as the standard deviation of a row from the line through its neighbours [mm].

        A commanded path is straight but for its corners: it has none. Rows laid between the path's own points are on
        the line and do not count. Neither do turns of a path that goes up and down. Shape (3,).
        """
        time, tip = self.time, self.tip
        if len(tip) < 3:
            return np.zeros(3)
        gap = np.maximum(time[2:] - time[:-2], 1e-12)
        share = ((time[1:-1] - time[:-2]) / gap)[:, None]
        deviation = tip[1:-1] - (1 - share) * tip[:-2] - share * tip[2:]
        # Three rows with equal noise contribute; this scales their sum to the noise of one.
        deviation = deviation / np.sqrt(1 + share**2 + (1 - share) ** 2)
        inner = self.episode[2:] == self.episode[:-2]
        limit = CORNERS * max(int(inner.sum()), 1)
        noise = np.zeros(3)
        for k, axis in enumerate(deviation[inner].T):
            steps = axis[np.abs(axis) > 1e-9]
            if len(steps) > limit and np.mean(np.sign(steps[1:] * steps[:-1])) < ALTERNATES:
                noise[k] = MIDDLE * float(np.median(np.abs(steps)))
        return noise

    @property
    def dither(self) -> float:
        """Noise of the depth [mm]."""
        return float(self.dithers[2])

    @cached_property
    def row_site(self) -> np.ndarray:
        """Place of each row's episode, shape (n,), int64."""
        return self.site[self.episode]

    @cached_property
    def span(self) -> float:
        """Deepest commanded depth [mm], at least a thousandth."""
        return float(max(self.tip[:, 2].max(), 1e-3))

    @cached_property
    def stroke(self) -> float:
        """Range of commanded depth [mm], at least a thousandth."""
        return float(max(np.ptp(self.tip[:, 2]), 1e-3))

    @cached_property
    def nudged(self) -> tuple[Self, Self]:
        """The course with every tip a little deeper, and a little higher."""
        down = np.array([0.0, 0.0, NUDGE * self.stroke])
        return replace(self, tip=self.tip + down), replace(self, tip=self.tip - down)

    def of(self, episodes: np.ndarray) -> np.ndarray:
        """Return which rows belong to some episodes, shape (n,), bool."""
        mask = np.zeros(self.episodes, dtype=bool)
        mask[episodes] = True
        return mask[self.episode]
