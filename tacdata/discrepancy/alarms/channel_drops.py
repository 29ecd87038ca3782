"""A channel that drops, or jumps, in several presses and comes back: a contact that is loose, a cable that breaks.

Presses that are far off gather on one channel. Under the null hypothesis, that channel has as many as the others let
expect, by their beta-binomial distribution. A spike frame counts once a channel, whatever its size. What all channels
share is taken off.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import betabinom

from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.press_gains import FEWEST_CHANNELS, press_gains
from tacdata.discrepancy.alarms.randomization import rarest

FEWEST_PRESSES = 12
"""Presses, at least."""
FAR_Z = 6.0
"""A press of a channel is far off from so many times its usual scatter on [1]..."""
LEAST = 0.08
"""...and from this change of its gain on [1]."""
CALM = 0.3
"""Share of a channel's presses that its usual scatter is estimated from [1]: more of them may have dropped."""
NORMAL = 0.385
"""Size that this share of normal numbers stays below, over their standard deviation [1]."""
SEVERAL = 4
"""Presses that are far off the same way, at least: set on synthetic presses, seeds 1000 to 1019 and 1100 to 1139."""
RARE = 200
"""Beforehand, a press of a channel is far off for other reasons, as a spike, once in so many, known as by one such."""
MOST_NAMED = 3
MOST = 0.5
"""Share of the presses that are far off, at most [1]: more are no drops."""


def channel_drops(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of a channel that drops or jumps in several presses, or none."""
    course = cleaned.problem.setting.course
    if course.channels < FEWEST_CHANNELS or len(cleaned.episodes) < FEWEST_PRESSES:
        return []
    dropped_channel = drops(press_gains(cleaned))
    if dropped_channel is None:
        return []
    channel, far, change = dropped_channel
    names = ", ".join(course.names[int(cleaned.episodes[k])] for k in far[:MOST_NAMED])
    way = "less" if change < 0 else "more"
    return [
        Alarm(
            f"{course.channel_names[channel]} reads about {100 * abs(change):.0f} % {way} in {len(far)} "
            f"presses ({names}, ...), and as before between them",
            "look at its contact and its cable; move the cable by hand while a weight rests on the sensor",
        )
    ]


def drops(logs: np.ndarray) -> tuple[int, np.ndarray, float] | None:
    """Return which channel drops or jumps, in which presses, and by which share of its gain; None if none does.

    Args:
        logs: Logarithm of the gain of each press and channel, relative to the median of its channels and of its place
            [1], shape (presses, channels); NaN where it is not known.
    """
    finite = np.isfinite(logs)
    # A press that few channels feel has no median to compare a channel with.
    finite &= finite.sum(axis=1, keepdims=True) >= FEWEST_CHANNELS
    finite &= finite.sum(axis=0) >= FEWEST_PRESSES
    if np.count_nonzero(finite.any(axis=0)) < FEWEST_CHANNELS:
        return None
    deviation = np.where(finite, logs, 0.0)
    scatter = np.array(
        [
            _scatter(channel_deviation[presses_of_channel])
            for channel_deviation, presses_of_channel in zip(deviation.T, finite.T, strict=True)
        ]
    )
    # Few presses may seem calm by chance. The one that drops is no calmer than most.
    scatter = np.maximum(scatter, np.median(scatter[np.isfinite(scatter)]))
    shares = np.abs(deviation) / np.maximum(LEAST, FAR_Z * scatter)
    far = finite & (shares > 1)
    count, presses_of_channel = far.sum(axis=0), finite.sum(axis=0)
    drops_of_others, watched = far.sum() - count, finite.sum() - presses_of_channel
    # How often others drop is itself uncertain: a beta-binomial tail, with the others' drops as its prior.
    tails = betabinom.sf(count - 1, presses_of_channel, 1 + drops_of_others, RARE + watched - drops_of_others)
    test = rarest(np.where((count >= SEVERAL) & (count <= MOST * presses_of_channel), tails, 1.0))
    if not test.alarms:
        return None
    presses, channel_deviation = np.flatnonzero(far[:, test.at]), deviation[:, test.at]
    # Where most presses of a place have dropped, the others seem to be the odd ones: the usual way is that of most.
    way = 1.0 if np.sum(np.sign(channel_deviation[presses])) > 0 else -1.0
    presses = presses[np.sign(channel_deviation[presses]) == way]
    if len(presses) < SEVERAL:
        return None
    return test.at, presses, float(np.expm1(np.median(channel_deviation[presses])))


def _scatter(deviation: np.ndarray) -> float:
    """Return the usual scatter of a channel [1]; infinite where it has no presses.

    In some presses it is itself the median that was taken off: a deviation of 0 is no sign of calm.
    """
    size = np.abs(deviation[deviation != 0])
    return float(np.quantile(size, CALM)) / NORMAL if len(size) else np.inf
