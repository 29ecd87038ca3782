"""Gain of each channel in each press, over that of the other presses of its place."""

from __future__ import annotations

import numpy as np

from tacdata.chain import predict
from tacdata.discrepancy.alarms.cleaned import Cleaned
from tacdata.discrepancy.data.single_channels import risen

STIRRED = 0.15
"""A press of which a channel rises by less, over its largest rise, gives it no gain [1]."""
SURE = 0.01
"""Nor does one of which noise, or half a step of its numbers, may change the gain by more [1].

Set on synthetic presses of a fitted response, seeds 1000 to 1019 and 1100 to 1139.
"""
DEPTHS = 12
"""Intervals of depth, over the stroke, that two presses are compared in."""
FEWEST_EACH = 4
"""Presses of a place, at least: the median of two others would be their mean, and follow one odd press."""
FEWEST_CHANNELS = 3
"""Channels that a press stirs, at least: the others show what is common."""


def press_gains(cleaned: Cleaned) -> np.ndarray:
    """Return the logarithm of each press's gain of each channel [1], shape (presses, channels); NaN where unknown.

    A response that was fitted to all presses follows those of a low gain in part. Two presses of a place have the same
    error of it at the same depth: their ratio, over the depths that both hold, is free of it. Each press is compared
    with the others of its place, and the median taken. So presses that drop are left out as long as they are fewer.
    The median of its channels is what a press errs in depth; it is taken off.
    """
    course, setting = cleaned.course, cleaned.problem.setting
    placed = [*setting.given, *cleaned.problem.placed]
    predicted = predict(setting.course, setting.response, placed).signal[setting.course.read]
    rows = [np.flatnonzero(course.episode == e) for e in cleaned.episodes]
    measured, expected = [risen(course.readings[r]) for r in rows], [risen(predicted[r]) for r in rows]
    peak = np.array([np.abs(rise).max(axis=0) for rise in expected])
    edges = np.linspace(0.0, max(float(course.tip[:, 2].max()), 1e-9), DEPTHS + 1)
    shape = len(rows), DEPTHS, course.channels
    products, power, deepest = np.zeros(shape), np.zeros(shape), np.zeros(len(rows), dtype=np.int64)
    for k, press in enumerate(rows):
        at = np.clip(np.searchsorted(edges, course.tip[press, 2], side="right") - 1, 0, DEPTHS - 1)
        pressed = course.tip[press, 2] > 0
        np.add.at(products[k], at[pressed], np.nan_to_num(measured[k] * expected[k])[pressed])
        np.add.at(power[k], at[pressed], np.square(expected[k])[pressed])
        deepest[k] = at.max()
    place = np.array([cleaned.problem.null.context[press[0]] for press in rows], dtype=np.int64)
    if not setting.response.fitted:
        place[:] = 0  # the model knows how places differ
    logs = _over_others(products, power, deepest, place)
    noise, step = _grain(course.readings, measured)
    smallest_rise = np.maximum(STIRRED * peak.max(axis=0), 0.5 * step / SURE)
    logs[(peak < smallest_rise) | (SURE * np.sqrt(power.sum(axis=1)) <= noise)] = np.nan
    return _relative_to_median(logs)


def _grain(readings: np.ndarray, measured: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return each channel's noise as presses begin, and the step of its numbers [its unit], shapes (channels,)."""
    begins = np.concatenate([rise[: max(len(rise) // 10, 1)] for rise in measured])
    noise = 1.4826 * np.nanmedian(np.abs(begins), axis=0)
    steps = np.array([np.diff(np.unique(channel[np.isfinite(channel)])).min(initial=np.inf) for channel in readings.T])
    return noise, steps


def _over_others(products: np.ndarray, power: np.ndarray, deepest: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the median logarithm of the ratio of each press to the others of its place, shape (presses, channels).

    Args:
        products: Readings times those expected, summed by depth, shape (presses, depths, channels).
        power: Squares of those expected, summed by depth, of the same shape.
        deepest: Last interval of depth of each press, shape (presses,), int64.
        place: Of each press, shape (presses,), int64.
    """
    logs = np.full(products.shape[::2], np.nan)
    gains = np.divide(products, power, out=np.zeros_like(products), where=power > 0)
    for k in range(len(products)):
        neighbours = np.flatnonzero((place == place[k]) & (np.arange(len(products)) != k))
        if len(neighbours) < FEWEST_EACH - 1:
            continue
        # Over depths that both presses reach: a channel's gain may depend on depth.
        shared = np.arange(products.shape[1]) <= np.minimum(deepest[k], deepest[neighbours])[:, None]
        weight = np.minimum(power[k], power[neighbours]) * shared[:, :, None]
        weighted, weighted_neighbours = (weight * gains[k]).sum(axis=1), (weight * gains[neighbours]).sum(axis=1)
        positive = (weighted > 0) & (weighted_neighbours > 0)
        ratio = np.log(np.where(positive, weighted, 1.0)) - np.log(np.where(positive, weighted_neighbours, 1.0))
        enough = positive.sum(axis=0) >= FEWEST_EACH - 1
        logs[k, enough] = np.nanmedian(np.where(positive, ratio, np.nan)[:, enough], axis=0)
    return logs


def _relative_to_median(logs: np.ndarray) -> np.ndarray:
    """Return logarithms of gains less the median of their press; NaN where it has few."""
    enough = np.isfinite(logs).sum(axis=1) >= FEWEST_CHANNELS
    relative = np.full(logs.shape, np.nan)
    relative[enough] = logs[enough] - np.nanmedian(logs[enough], axis=1, keepdims=True)
    return relative
