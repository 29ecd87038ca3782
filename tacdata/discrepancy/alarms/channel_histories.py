"""Channels that follow the path each in its own way: a cable that moves along, a torn protrusion.

The gate asks for patterns that all channels share. Here each channel has a weight of its own. Squared scores are
summed over channels. For the null distribution, whole presses change sign (wild cluster bootstrap). The fit is taken
off before, with leverage as in HC3. So channels keep their correlation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tacdata.chain import Course
from tacdata.chain.memory import low_pass, play, running_max
from tacdata.discrepancy.alarms.alarm import Alarm
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.alarms.randomization import DRAWS, Largest, largest
from tacdata.discrepancy.plain_number import plain_number
from tacdata.discrepancy.regressors.generic import depth_share
from tacdata.discrepancy.statistics.gram_fit import flips

FEWEST = 12
"""Presses, at least."""
MOST_LEVERAGE = 0.5
"""A channel of which one press holds a larger share of the information does not count [1]."""
STIRRED = 0.02
"""Nor does one with less of it, over the best channel's [1]."""
FEWEST_CHANNELS = 2
MOST_NAMED = 4
USUAL = 0.95
"""A size is reported where the history has this quantile [1]."""

TIME_CONSTANTS = (0.1, 0.4, 1.5, 6.0, 25.0)
"""Of leaky means of depth [s]."""
OFFSET, RISE, LATE = "offset", "rise", "late"
"""Quantity that a channel's weight moves: its reading at any press, its rise, its time."""


@dataclass(frozen=True)
class Best:
    """The history that channels follow most."""

    kind: str
    history: str
    over: str
    """Covariate of its size: "", the time or the temperature."""
    test: Largest
    weight: np.ndarray
    """Weight of each channel [its unit, 1 or s, over the history], shape (channels,); 0 where it does not count."""
    size: np.ndarray
    """How far its readings move [their unit], shape (channels,)."""


def channel_histories(cleaned: Cleaned) -> list[Alarm]:
    """Return the alarm of channels that follow the path each in its own way, or none."""
    if len(cleaned.begins) < FEWEST or cleaned.course.channels < FEWEST_CHANNELS:
        return []
    best = strongest(cleaned)
    return [] if best is None or not best.test.alarms else [_told(cleaned, best)]


def strongest(cleaned: Cleaned, seed: int = 0) -> Best | None:
    """Return the history that channels follow most, with its p-value over all of them."""
    candidates, tables, beyond = [], [], []
    signs: np.ndarray | None = None
    for kind, history, covariate, column in _columns(cleaned):
        white = cleaned.whitened(column)
        score, information = cleaned.sums(white * cleaned.residual), cleaned.sums(white * white)
        if signs is None:
            # All histories share the flips: the distribution of the largest statistic keeps their correlation.
            signs = flips(len(score), DRAWS + 1, seed)[1:]
        total = information.sum(axis=0)
        # A press that alone determines a column follows it whatever the cause.
        leverage = information / np.maximum(total, 1e-30)
        counts = (leverage.max(axis=0) < MOST_LEVERAGE) & (total > STIRRED * total.max(initial=0.0))
        if counts.sum() < FEWEST_CHANNELS:
            continue
        score, total, leverage = score[:, counts], total[counts], leverage[:, counts]
        weight = score.sum(axis=0) / total
        # Residual scores: flips of the raw ones would contain the effect that is looked for.
        scores = (score - information[:, counts] * weight) / (1 - leverage) / np.sqrt(total)
        null = np.square(signs @ scores).sum(axis=1) * _scatter(scores)
        observed = float(np.sum(score.sum(axis=0) ** 2 / total))
        tables.append(np.append(observed, null))
        beyond.append(observed - null.mean() >= cleaned.least_of_channels)
        full_weight = np.zeros(len(counts))
        full_weight[counts] = weight
        candidates.append(
            (kind, history, covariate, full_weight, np.abs(full_weight) * np.quantile(np.abs(column), USUAL, axis=0))
        )
    if not candidates:
        return None
    test = largest(np.stack(tables, axis=1), np.array(beyond))
    kind, history, covariate, weight, size = candidates[test.at]
    return Best(kind, history, covariate, test, weight, size)


def _scatter(scores: np.ndarray) -> float:
    """Return by how much scores, shape (presses, channels), scatter beyond their flips [1], 1 or more.

    Flips take presses as independent. Slow noise makes sums scatter by more. Few presses may scatter by chance by
    less than in the noise model. That is the least.
    """
    later, earlier = scores[1:], scores[:-1]
    size = float(np.sqrt(np.sum(np.square(later)) * np.sum(np.square(earlier))))
    lagged = max(float(np.sum(later * earlier)) / max(size, 1e-30), 0.0)
    mean = float(np.square(scores).sum(axis=0).mean())
    return (1 + 2 * lagged) * max(1.0, 1 / max(mean, 1e-30))


def _columns(cleaned: Cleaned) -> Iterator[tuple[str, str, str, np.ndarray]]:
    """Yield candidates of a channel: kind, history, covariate, and the column (m, channels)."""
    course, rise = cleaned.problem.setting.course, cleaned.rise
    reduced, read = course.reduced, course.read
    step = np.maximum(reduced.step, 1e-9)[:, None]
    # Readings that are late by t differ by t times their rate, to first order.
    rate = np.where(reduced.first[:, None], 0.0, np.diff(rise, axis=0, prepend=rise[:1]) / step)
    span = max(float(np.ptp(course.time)), 1e-9)
    covariates = [("", np.ones(len(read))), ("the time", 2 * (reduced.time - reduced.time.mean()) / span)]
    if course.temperature is not None:
        warm = course.temperature[read]
        covariates.append(("the temperature", (warm - warm.mean()) / max(float(np.std(warm)), 1e-9)))
    flat = np.ones_like(rise)
    named_histories = [(name, values[read][:, None]) for name, values in _histories(course).items()]
    leaving = np.sign(cleaned.speed)[:, None]
    for goes, by in covariates:
        for name, values in named_histories:
            yield RISE, name, goes, values * rise * by[:, None]
            if not goes:  # a press's own offset, and a session's, is drift
                yield OFFSET, name, goes, cleaned.without_mean(values) * flat
        yield LATE, "", goes, -rate * by[:, None]
        if goes:
            yield LATE, "between loading and unloading", goes, -rate * leaving * by[:, None]


def _histories(course: Course) -> dict[str, np.ndarray]:
    """Return the histories of a path, by name, each (n,) of size about 1."""
    share = depth_share(course)
    speed = course.speed
    fast = np.abs(speed) / max(float(np.abs(speed).max()), 1e-9)
    lags = {f"what was pressed {tau:g} s before": low_pass(share, course.step, tau) for tau in TIME_CONSTANTS}
    turning = {f"turning back by {100 * r:.0f} % of the depth": play(share, r) - share for r in (0.03, 0.1, 0.3)}
    return {
        "loading or unloading": np.sign(speed),
        "loading or unloading, and how fast": np.sign(speed) * fast,
        "the speed": fast,
        "how deep its place was pressed before": running_max(share, course.row_site) - share,
        "how deep this press has been": running_max(share, course.episode) - share,
        "unloading": share * (speed < 0),
        **lags,
        **turning,
    }


def _told(cleaned: Cleaned, best: Best) -> Alarm:
    order = np.argsort(-best.size)[:MOST_NAMED]
    order = order[best.size[order] > 0]
    names = ", ".join(cleaned.problem.setting.course.channel_names[c] for c in order)
    peak = float(best.size[order[0]])
    share = plain_number(100 * peak / cleaned.largest, 2)
    large = f"the largest change is about {plain_number(peak, 2)} in readings, {share} % of the largest rise"
    changes = f", and that goes with {best.over}" if best.over else ""
    if best.kind == LATE:
        delay = 1e3 * float(np.abs(best.weight).max())
        where = f" {best.history}" if best.history else ""
        finding = f"channels are late by times of their own{where}, up to {plain_number(delay, 2)} ms{changes}; {large}"
        following = "look at the order and the times at which channels are read; press at three speeds"
    elif best.kind == OFFSET:
        finding = (
            f"channels move with the path whatever presses them, each its own way ({best.history}{changes}); {large}"
        )
        following = "make the same paths beside the skin, in the air: what stays is of a cable or a plug that moves"
    else:
        finding = f"channels read more or less of a press by {best.history}, each its own way{changes}; {large}"
        following = "look at what lies over these channels (torn, loose, dirty), and press there slowly, down and up"
        if "before" in best.history:
            following = "hold at one depth for a minute, wait as long between presses: do channels settle apart?"
    if best.over == "the time":
        following = "make the same presses at the begin and the end of a session; say what was changed in between"
    elif best.over:
        following = "make the same presses cold and warm"
    return Alarm(f"{finding}, on {names}", following)
