"""How much readings scatter, told from the recordings themselves."""

from __future__ import annotations

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.evidence import Noise


def first_guess(residual: np.ndarray, course: Course) -> Noise:
    """Return white noise by second differences, shape of residual (n, streams)."""
    inner = ~course.first & ~np.roll(course.first, -1) & ~np.roll(course.first, 1)
    second = residual[1:-1] - 0.5 * (residual[:-2] + residual[2:])
    second = second[inner[1:-1]]
    scale = 1.4826 * np.median(np.abs(second), axis=0) / np.sqrt(1.5) if len(second) else np.std(residual, axis=0)
    floor = 1e-3 * np.std(residual, axis=0) + 1e-12
    return Noise(np.maximum(scale, floor), 0.0, np.inf)


def refined(leftover: np.ndarray, course: Course, before: Noise) -> Noise:
    """Return noise with memory, told from what an over-rich fit leaves.

    Args:
        leftover: Shape (n, streams).
        course: Whose rows.
        before: The guess so far.
    """
    inside = ~course.first
    median = float(np.median(course.step[inside])) if inside.any() else 1.0
    pairs = inside & (course.step < 1.5 * median)
    later, earlier = leftover[pairs], leftover[np.flatnonzero(pairs) - 1]
    weight = 1 / np.maximum(np.mean(np.square(leftover), axis=0), 1e-24)
    products = float(np.sum(later * earlier * weight))
    squares = float(np.sum(0.5 * (later**2 + earlier**2) * weight))
    memory = float(np.clip(products / max(squares, 1e-12), 0.0, 0.98))
    spread = 1.4826 * np.median(np.abs(leftover - np.median(leftover, axis=0)), axis=0)
    mixed = np.maximum(0.5 * (spread + leftover.std(axis=0)), before.scale * 0.3)
    return Noise(mixed * np.sqrt(max(1 - memory**2, 0.02)), memory, before.offset)


def wander(residual: np.ndarray, course: Course, known: Noise) -> float:
    """Return how far an episode's offset is off a smooth course in time, as a standard deviation in noise scales [1].

    Enlarged by what successive episodes have in common, so that a slow wander is no evidence of drift.

    Args:
        residual: Shape (n, streams).
        course: Whose rows.
        known: Noise so far.
    """
    quiet = course.tip[:, 2] <= max(0.0, float(course.tip[:, 2].min()) + 0.05 * course.stroke)
    means, times = [], []
    for number in range(course.episodes):
        rows = quiet & (course.episode == number)
        if rows.sum() >= 3:
            means.append(residual[rows].mean(axis=0) / known.scale)
            times.append(course.time[rows].mean())
    if len(means) < 6:
        return np.inf
    line = np.vander(np.array(times) / max(times[-1], 1e-9), 4 if len(times) >= 16 else 2)
    offsets = np.array(means)
    offsets = offsets - line @ np.linalg.lstsq(line, offsets, rcond=None)[0]
    power = float(np.sum(offsets**2))
    common = float(np.clip(np.sum(offsets[1:] * offsets[:-1]) / max(power, 1e-12) + 2 / len(offsets), 0.0, 0.95))
    spread = np.sqrt(power / offsets.size * (1 + common) / (1 - common))
    return float(max(spread, 0.2))


def gain_spread(residual: np.ndarray, rises: np.ndarray, context: np.ndarray) -> float:
    """Return how far an episode's gain of a stream is off the others', as a standard deviation [1].

    Presses that miss their place by a little read a little more here and less there: random to every model without
    a gradient.

    Args:
        residual: Whitened and without nuisances, shape (n, streams).
        rises: What the response says above idle in the rows of one episode of each place, alike, shape (n, streams, k).
        context: Place of each row, shape (n,).
    """
    top = weight = 0.0
    for key in np.unique(context):
        rows = context == key
        power = np.square(rises[rows]).sum(axis=0)
        product = np.einsum("nsk,ns->sk", rises[rows], residual[rows])
        known = power > 1.0
        # product = gain * power + noise of variance power: unbiased for the variance of gain, weighted by power.
        top += float(np.sum(product[known] ** 2 / power[known] - 1))
        weight += float(np.sum(power[known]))
    return float(np.sqrt(max(top, 0.0) / max(weight, 1e-12)))


def number_within(context: np.ndarray, episode: np.ndarray) -> np.ndarray:
    """Return the number of each row's episode among those of its place, from 0, shape (n,), int64."""
    result = np.zeros(len(context), dtype=np.int64)
    for key in np.unique(context):
        rows = context == key
        result[rows] = np.unique(episode[rows], return_inverse=True)[1]
    return result


def still(known: Noise, streams: int) -> Noise:
    """Return noise that whitens nothing, so that what is left keeps its memory and size."""
    return Noise(np.ones(streams), 0.0, known.offset)
