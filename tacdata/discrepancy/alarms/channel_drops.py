"""A channel that drops, or jumps, in several presses and comes back: a contact that is loose, a cable that breaks.

Each press's gain of each channel is divided by the median of all channels: a common part (a depth error) cancels.
Large deviations that gather on one channel are the statistic. For the null distribution, channels change places within
each press. So the effects of a single press, as a spike frame, and of all channels together are in it.
"""

from __future__ import annotations

import numpy as np

from tacdata.chain import predict
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.randomization import DRAWS, largest
from tacdata.discrepancy.data.single_channels import press_gains, risen

FEWEST_PRESSES, FEWEST_CHANNELS = 12, 3
"""Presses and channels, at least."""
FAR_Z = 6.0
"""A press of a channel is far off from so many times its usual scatter on [1]..."""
LEAST = 0.08
"""...and from this change of its gain on [1]."""
SEVERAL = 3
"""Presses that are far off, at least."""
MOST = 0.5
"""Share of the presses that are far off, at most [1]: more are no drops."""


def channel_drops(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of a channel that drops or jumps in several presses, or none."""
    course, setting = cleaned.course, cleaned.problem.setting
    if course.channels < FEWEST_CHANNELS or len(cleaned.episodes) < FEWEST_PRESSES:
        return []
    placed = [*setting.given, *cleaned.problem.placed]
    predicted = predict(setting.course, setting.response, placed).signal[setting.course.read]
    rows = [np.flatnonzero(course.episode == e) for e in cleaned.episodes]
    gains = press_gains([risen(course.readings[r]) for r in rows], [risen(predicted[r]) for r in rows])
    drop = drops(gains)
    if drop is None:
        return []
    channel, far, change = drop
    names = ", ".join(setting.course.names[int(cleaned.episodes[k])] for k in far[:SEVERAL])
    way = "less" if change < 0 else "more"
    return [
        Alarm(
            f"{setting.course.channel_names[channel]} reads about {100 * abs(change):.0f} % {way} in {len(far)} "
            f"presses ({names}, ...), and as before between them",
            "look at its contact and its cable; move the cable by hand while a weight rests on the sensor",
        )
    ]


def drops(gains: np.ndarray, seed: int = 0) -> tuple[int, np.ndarray, float] | None:
    """Return which channel drops or jumps, in which presses, and by which share of its gain; None if none does.

    Args:
        gains: Of each press and channel, over the channel's median [1], shape (presses, channels); NaN where a press
            hardly stirs it.
        seed: Of the draws.
    """
    valid = np.isfinite(gains) & (gains > 0)
    with np.errstate(invalid="ignore"):
        logs = np.where(valid, np.log(np.where(valid, gains, 1.0)), np.nan)
    rows = np.count_nonzero(valid, axis=1) >= FEWEST_CHANNELS
    if np.count_nonzero(rows) < FEWEST_PRESSES:
        return None
    logs = np.where(rows[:, None], logs, np.nan)
    logs[rows] -= np.nanmedian(logs[rows], axis=1, keepdims=True)
    enough = np.isfinite(logs).sum(axis=0) >= FEWEST_PRESSES
    if np.count_nonzero(enough) < FEWEST_CHANNELS:
        return None
    logs[:, ~enough] = np.nan
    logs[:, enough] -= np.nanmedian(logs[:, enough], axis=0)
    scatter = np.full(gains.shape[1], np.inf)
    scatter[enough] = 1.4826 * np.nanmedian(np.abs(logs[:, enough]), axis=0)
    deviation = np.nan_to_num(logs)
    far = np.abs(deviation) > np.maximum(LEAST, FAR_Z * scatter)
    table = np.empty((DRAWS + 1, gains.shape[1]))
    # Counts are compared as they are: the harness takes cube roots, as of sums of squares.
    table[0] = far.sum(axis=0) ** 3.0
    rng = np.random.default_rng([seed, 37])
    for draw in range(1, DRAWS + 1):
        table[draw] = np.sum(rng.permuted(far, axis=1), axis=0) ** 3.0
    count = far.sum(axis=0)
    test = largest(table, (count >= SEVERAL) & (count <= MOST * np.maximum(np.isfinite(logs).sum(axis=0), 1)))
    if not test.alarms:
        return None
    presses = np.flatnonzero(far[:, test.at])
    return test.at, presses, float(np.expm1(np.median(deviation[presses, test.at])))
