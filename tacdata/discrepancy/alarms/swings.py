"""Swings of all channels together that differ from press to press: stick-slip, a shaking press.

Their mean over presses is zero: no score test sees them. Readings are projected on the rise times waves, along the
path and in time. For the null distribution, channels change sign in each press. Single channels' noise keeps its
spectrum, its tails and its growth. Only the common part of channels makes a difference. A press's own errors are
projected out before.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.motor_lines import hums
from tacdata.discrepancy.alarms.randomization import DRAWS, Largest, largest
from tacdata.discrepancy.plain_number import plain_number

FEWEST = 12
"""Presses, at least."""
MOST_PRESSES = 200
"""Of more presses, as many are taken, evenly over the session."""
FEWEST_ROWS = 20
"""Rows in contact of a press, at least."""
FEWEST_CHANNELS = 3
WAVES = np.arange(4.0, 20.1, 0.5)
"""Waves along the path [over the stroke]."""
HERTZ = np.array([0.5, 0.75, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0])
"""Swings in time [Hz]."""
FEWEST_WAVES = 4.0
"""Waves that fit into a press, at least. A press's own errors are slower."""
ALIAS = 0.12
"""Waves that nearly fit into the way between two readings look like none [their length]."""
MOVES = 0.05
"""Rows move from this share of the usual largest rate of depth on [1]."""
USUAL_RATE = 0.95
"""Quantile of the rates of depth that counts as the usual largest [1]."""


@dataclass(frozen=True)
class Swing:
    """The wave with the most energy beyond chance."""

    wave: int
    """Its number: `WAVES`, then `HERTZ`."""
    test: Largest
    share: float
    """Its amplitude over the rise [1]."""


def swings(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of swings that differ between presses, or none."""
    swing = strongest(cleaned)
    if swing is None or not swing.test.alarms:
        return []
    share, peak = plain_number(100 * swing.share, 2), plain_number(swing.share * cleaned.largest, 2)
    size = f"by about {share} % of the rise, up to {peak} in readings"
    if swing.wave < len(WAVES):
        wavelength = cleaned.problem.setting.course.stroke / WAVES[swing.wave]
        return [
            Alarm(
                f"in each press all channels swing together along the path, every {wavelength:.2g} mm or a "
                f"part of it, {size}, "
                "each time with another beginning: as friction does that lets go in jumps (stick-slip)",
                "press slower and faster, and with a drop of oil or some powder between tool and "
                "skin; look at the guide",
            )
        ]
    hertz = HERTZ[swing.wave - len(WAVES)]
    return [
        Alarm(
            f"in each press all channels swing together at about {hertz:.2g} Hz, {size}, each time "
            "with another beginning: "
            "as a press does that shakes",
            "measure force or height while the tool stands still in contact; look at the drive's "
            "regulator and its footing",
        )
    ]


def strongest(cleaned: Cleaned, seed: int = 0) -> Swing | None:
    """Return the wave with the most energy beyond chance, with its p-value over all of them; None if untestable."""
    projections = [(_projected(cleaned, rows), cleaned.course.episode[rows[:1]]) for rows in _presses(cleaned)]
    valid = [(*projection, of[0]) for projection, of in projections if projection is not None]
    if len(valid) < FEWEST or cleaned.course.channels < FEWEST_CHANNELS:
        return None
    # Of shapes (presses, channels, waves), (presses, waves), (presses,).
    parts, power, episodes = (np.array(each) for each in zip(*valid, strict=True))
    diagonal = np.square(np.abs(parts)).sum(axis=1)
    # A press counts by the root of its energy: a single strong one must not decide.
    weight = 1 / np.sqrt(np.where(diagonal > 0, diagonal, np.inf))
    energy = np.zeros((DRAWS + 1, parts.shape[2]))
    rng = np.random.default_rng([seed, 29])
    together = episodes
    if hums(cleaned):
        # Channels that hum have fixed phases: at one place they add up equally in each press.
        place = np.zeros(cleaned.problem.setting.course.episodes, dtype=np.int64)
        place[cleaned.course.episode] = cleaned.problem.null.context
        together = place[episodes]
    signs: dict[int, np.ndarray] = {}
    for part, by, at in zip(parts, weight, together.tolist(), strict=True):
        if at not in signs:
            signs[at] = rng.integers(0, 2, (DRAWS + 1, len(part))) * 2.0 - 1.0
            # Row 0 is the data as it is.
            signs[at][0] = 1.0
        # Random signs of whole channels keep each channel's spectrum, and destroy its agreement with the others.
        energy += by * (np.square(signs[at] @ part.real) + np.square(signs[at] @ part.imag))
    energy[1:] *= 1 + _shared_in_air(cleaned)
    # Energy of the sum of all channels less the sum of their energies: only what they have in common remains.
    beyond = np.square(np.abs(parts.sum(axis=1))) - diagonal
    size = 4 * beyond.sum(axis=0) / np.maximum(np.square(power).sum(axis=0), 1e-30)
    explained = (2 * beyond / np.maximum(power, 1e-30)).sum(axis=0)
    test = largest(energy, explained >= cleaned.least)
    return Swing(test.at, test, float(np.sqrt(max(size[test.at], 0.0))))


def _shared_in_air(cleaned: Cleaned) -> float:
    """Return by how much channels add up in the air beyond chance [1], 0 or more.

    There, noise is all they share. They weigh as in each press, by its largest rise.
    """
    inside = cleaned.course.tip[:, 2] > 0
    edges = [*cleaned.begins, len(inside)]
    together = diagonal = 0.0
    for first, last in pairwise(edges):
        rows = np.arange(first, last)
        air = rows[~inside[rows]]
        weighted = cleaned.residual[air] * (np.abs(cleaned.rise[rows]).max(axis=0) / cleaned.noise.scale)
        together += float(np.sum(np.square(weighted.sum(axis=1))))
        diagonal += float(np.sum(np.square(weighted)))
    return max(together / diagonal - 1.0, 0.0) if diagonal > 0 else 0.0


def _presses(cleaned: Cleaned) -> list[np.ndarray]:
    """Return the rows in contact of each press."""
    inside = cleaned.course.tip[:, 2] > 0
    edges = [*cleaned.begins, len(inside)]
    numbers = np.unique(np.linspace(0, len(cleaned.begins) - 1, min(len(cleaned.begins), MOST_PRESSES)).astype(int))
    each = [np.arange(edges[k], edges[k + 1]) for k in numbers]
    return [rows[inside[rows]] for rows in each]


def _projected(cleaned: Cleaned, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the amplitudes (channels, waves) of each wave in a press, and its information; None if too short."""
    if len(rows) < FEWEST_ROWS:
        return None
    course, noise, stroke = cleaned.course, cleaned.noise, cleaned.problem.setting.course.stroke
    shape = cleaned.rise[rows] / noise.scale
    if noise.relative_scale is not None:
        shape = shape / noise.relative_scale[rows]
    time = course.time[rows] - course.time[rows[0]]
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(course.tip[rows, 2])))]) / stroke
    rate = np.abs(cleaned.speed)
    moving = rate[rows] > MOVES * np.quantile(rate, USUAL_RATE)
    if not moving.any():
        return None
    interval = max(float(np.median(np.diff(time))), 1e-9)
    phase = WAVES * float(np.median(rate[rows][moving])) * interval / stroke
    # A wave that is sampled at about its own period looks like a constant.
    resolved = (WAVES * way[-1] >= FEWEST_WAVES) & ((phase < 0.5) | (np.abs(phase - np.round(phase)) >= ALIAS))
    # Near the Nyquist frequency, half a wave a row, a frequency has its alias next to it.
    in_time = (HERTZ * time[-1] >= FEWEST_WAVES) & (HERTZ * interval <= 0.45)
    waves = np.exp(2j * np.pi * np.concatenate([way[:, None] * WAVES, time[:, None] * HERTZ], axis=1))
    waves[:, : len(WAVES)] *= moving[:, None]
    waves[:, ~np.concatenate([resolved, in_time])] = 0.0
    power = np.square(np.abs(waves)).T @ np.square(shape).sum(axis=1)
    return (shape * cleaned.residual[rows]).T @ waves, power
