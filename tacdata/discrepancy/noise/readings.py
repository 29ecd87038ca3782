"""Noise of single readings: scale, autocorrelation, load dependence, and spreads between episodes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from tacdata.chain import Course
from tacdata.discrepancy.noise.noise_model import Noise

LOAD_EDGES = (0.0, 0.03, 0.1, 0.25, 0.5, 0.75, 1.0)
"""Load dependence: edges of the classes, as shares of the largest rise [1]."""
LEAST_GROWTH = 1.2
"""Load dependence: noise that grows by a smaller factor is taken as constant [1]."""
MOST_GROWTH = 5.0
"""Load dependence: largest factor [1]."""
FEWEST_DIFFERENCES = 150
"""Load dependence: fewer second differences estimate no standard deviation."""


def relative_scale(residual: np.ndarray, rise: np.ndarray, course: Course) -> np.ndarray | None:
    """Return how much larger noise is in each value than without load [1], shape (n, streams); None: it is not.

    Estimated by second differences, which a missing effect hardly touches.

    Args:
        residual: Shape (n, streams).
        rise: Rise of each stream under presses, shape (n, streams).
        course: Whose rows.
    """
    magnitude = np.abs(rise[:, : course.channels])
    share = magnitude / max(float(magnitude.max(initial=0.0)), 1e-12)
    second, inside = _second(residual[:, : course.channels], course)
    at, read = share[1:-1][inside], np.isfinite(second)
    quiet = read & (at <= LOAD_EDGES[1])
    count, power = quiet.sum(axis=0), np.sum(np.square(second), axis=0, where=quiet)
    # A stream that is mostly constant without load, or was not read, has no information.
    informative = np.sum(quiet & (second != 0), axis=0) > 0.5 * count
    if count[informative].sum() < FEWEST_DIFFERENCES:
        return None
    size = np.sqrt(power[informative] / count[informative])
    second, at, is_read = second[:, informative] / size, at[:, informative], read[:, informative]
    nodes, levels = [0.0], [_spread(second[is_read & (at <= LOAD_EDGES[1])])]
    for low, high in itertools.pairwise(LOAD_EDGES[1:]):
        inside = is_read & (at > low) & (at <= high)
        if inside.sum() >= FEWEST_DIFFERENCES:
            nodes.append(float(np.mean(at[inside])))
            levels.append(_spread(second[inside]))
    size = np.clip(np.array(levels) / max(levels[0], 1e-12), 1.0, MOST_GROWTH)
    if size.max() < LEAST_GROWTH:
        return None
    result = np.ones(residual.shape, dtype=np.float32)
    result[:, : course.channels] = np.interp(share, nodes, size)
    return result


def _spread(values: np.ndarray) -> float:
    """Return the standard deviation of values, half by their median: neither few outliers nor coarse steps decide."""
    return 0.5 * float(1.4826 * np.median(np.abs(values)) + np.sqrt(np.mean(np.square(values))))


def _second(residual: np.ndarray, course: Course) -> tuple[np.ndarray, np.ndarray]:
    """Return second differences (m, streams) where an episode has a row before and after; where that is, (n - 2,)."""
    inner = (~course.first & ~np.roll(course.first, -1) & ~np.roll(course.first, 1))[1:-1]
    return (residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]))[inner], inner


def first_guess(residual: np.ndarray, course: Course, relative: np.ndarray | None = None) -> Noise:
    """Return white noise by second differences.

    Args:
        residual: Shape (n, streams).
        course: Whose rows.
        relative: How much larger it is in each value than without load [1], shape (n, streams).
    """
    residual = residual if relative is None else residual / relative
    second, _ = _second(residual, course)
    observed = np.isfinite(residual).any(axis=0)  # a gauge sees the depth alone
    overall = np.ones(residual.shape[1])
    overall[observed] = np.nanstd(residual[:, observed], axis=0)
    enough = np.isfinite(second).sum(axis=0) > 10
    scale = overall.copy()
    if enough.any():
        # A reading less the mean of its neighbours has 1.5 times the variance of white noise.
        scale[enough] = 1.4826 * np.nanmedian(np.abs(second[:, enough]), axis=0) / np.sqrt(1.5)
    missing = ~np.isfinite(residual)
    tag = np.inf if course.tag is not None else None
    floor = np.maximum(scale, 1e-3 * overall)
    floor[floor == 0] = 1e-12  # a constant
    return Noise(
        floor, 0.0, median_step(course), missing=missing if missing.any() else None, tag=tag, relative_scale=relative
    )


def refined(leftover: np.ndarray, course: Course, previous: Noise) -> Noise:
    """Return autocorrelated noise, estimated from the residual of an over-rich fit.

    Args:
        leftover: Shape (n, streams).
        course: Whose rows.
        previous: The guess so far.
    """
    observed = np.isfinite(leftover).any(axis=0)
    if not observed.all():
        part = replace(previous, scale=previous.scale[observed], missing=None)
        estimate = refined(leftover[:, observed], course, part)
        scale = previous.scale.copy()
        scale[observed] = estimate.scale
        return replace(previous, scale=scale, memory=estimate.memory)
    # Rows on both sides of a gap in time would make the correlation of successive rows too small.
    pairs = ~course.first & (course.step < 1.5 * previous.step)
    later, earlier = leftover[pairs], leftover[np.flatnonzero(pairs) - 1]
    # Streams of different units: each counts by its own variance.
    weight = 1 / np.maximum(np.nanmean(np.square(leftover), axis=0), 1e-300)
    products = float(np.nansum(later * earlier * weight))
    squares = float(np.nansum(np.where(np.isfinite(later * earlier), 0.5 * (later**2 + earlier**2) * weight, 0.0)))
    memory = float(np.clip(products / max(squares, 1e-12), 0.0, 0.98))
    spread = 1.4826 * np.nanmedian(np.abs(leftover - np.nanmedian(leftover, axis=0)), axis=0)
    mixed = np.maximum(0.5 * (spread + np.nanstd(leftover, axis=0)), previous.scale * 0.3)
    # The scale is that of the innovations: in an AR(1) process their variance is 1 - memory^2 of the readings'.
    return replace(previous, scale=mixed * np.sqrt(max(1 - memory**2, 0.02)), memory=memory)


def median_step(course: Course) -> float:
    """Return the median time between rows of an episode [s]; 1 where no episode has two rows."""
    inside = ~course.first
    return max(float(np.median(course.step[inside])), 1e-9) if inside.any() else 1.0


def gain_spread(score: np.ndarray, information: np.ndarray, place: np.ndarray) -> float:
    """Return how far an episode's gain of a stream is off the next one's at its place, as a standard deviation [1].

    Presses that miss their place by a little read a little more here and less there: random to every model without
    a gradient.

    Args:
        score: Score of each episode's gain of each stream, shape (episodes, streams).
        information: How much it knows of it, shape (episodes, streams).
        place: Of each episode, shape (episodes,).
    """
    gaps, errors = [], []
    informative = information.max(axis=1) > 0  # sealed episodes have none
    for key in np.unique(place[informative]):
        power = information[informative & (place == key)]
        gain = score[informative & (place == key)] / np.maximum(power, 1e-9)
        pairs = (power[1:] > 1.0) & (power[:-1] > 1.0)
        gaps.append(np.diff(gain, axis=0)[pairs])
        errors.append((1 / np.maximum(power[1:], 1e-9) + 1 / np.maximum(power[:-1], 1e-9))[pairs])
    none = np.zeros(0)  # a single press: its splines absorb all information on gains
    return spread_of(np.concatenate([none, *gaps]), np.concatenate([none, *errors]))


MEDIAN_CHI2 = 0.4549
"""Median of the square of a standard normal number, chi square with one degree of freedom [1]."""
FEWEST_GAPS = 6
"""Spread: fewer differences of successive episodes estimate none."""
EQUAL_WEIGHTS = 40
"""Spread: the best known differences, so many, have equal weights: no few of them decide."""


def spread_of(gaps: np.ndarray, errors: np.ndarray) -> float:
    """Return the standard deviation that numbers have beyond their known errors, 0 or more.

    Estimated by the median of differences of successive ones: neither a slow change nor a step makes it larger. Each
    is weighted by its Fisher information on the spread, so that many uncertain ones do not drown the few good ones.

    Args:
        gaps: Differences of successive numbers, shape (n,).
        errors: Variance of each that is known, shape (n,).
    """
    if len(gaps) < FEWEST_GAPS:
        return 0.0
    square = np.square(gaps)
    floor = float(np.partition(errors, min(EQUAL_WEIGHTS, len(errors)) - 1)[min(EQUAL_WEIGHTS, len(errors)) - 1])

    def beyond(power: float) -> bool:
        # The median of chi-squared variables, not the mean: a single odd episode must not set the spread.
        ratio = square / np.maximum(2 * power + errors, 1e-30)
        weight = 1 / np.square(2 * power + np.maximum(errors, floor) + 1e-30)
        return float(weight[ratio > MEDIAN_CHI2].sum()) > 0.5 * float(weight.sum())

    low, high = 0.0, float(np.max(square)) + 1e-30
    if not beyond(0.0):
        return 0.0
    # Bisection: `beyond` changes once from true to false, and 60 halvings exhaust double precision.
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return float(np.sqrt(high))


DEPTH_INTERVALS = 10
"""Tag: intervals of the function of depth that is fitted for the estimate of its noise."""
FEWEST_VIEWS = 100
"""Tag: fewer views estimate no function of depth."""


def beside_depth(residual: np.ndarray, course: Course) -> np.ndarray:
    """Return residuals in which a tag's are without their function of depth, shape (n, streams).

    Splines take that out of readings with a fitted response, and nothing does it for a tag: a frame that gives way
    would be noise of the gauge that sees it, a hundred times too large. Each way has a function of its own.

    Args:
        residual: Shape (n, streams).
        course: Whose rows.
    """
    if course.tag is None:
        return residual
    result, depth = residual.copy(), np.clip(course.tip[:, 2] / max(float(course.tip[:, 2].max()), 1e-12), 0.0, 1.0)
    hats = np.maximum(1 - np.abs(depth[:, None] * DEPTH_INTERVALS - np.arange(1, DEPTH_INTERVALS + 1)), 0.0)
    leaving = (course.speed < 0)[:, None]
    columns = np.concatenate([np.where(leaving, 0.0, hats), np.where(leaving, hats, 0.0)], axis=1)
    for k in range(residual.shape[1] - 3, residual.shape[1]):
        rows = np.isfinite(residual[:, k])
        if rows.sum() < FEWEST_VIEWS:
            continue
        centred = [_about_mean(x, course.episode[rows]) for x in (columns[rows], residual[rows, k : k + 1])]
        gram = centred[0].T @ centred[0]
        gram += 1e-6 * max(float(np.trace(gram)) / len(gram), 1e-12) * np.eye(len(gram))
        result[:, k] -= columns @ np.linalg.solve(gram, centred[0].T @ centred[1])[:, 0]
    return result


def _about_mean(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return values, shape (n, k), less the mean of their group."""
    count = np.maximum(np.bincount(group), 1)
    means = np.stack([np.bincount(group, column) / count for column in values.T], axis=1)
    return values - means[group]


def tag_offset_spread(residual: np.ndarray, course: Course, noise: Noise) -> float | None:
    """Return how far an episode's offset of the tag is off the next one's, in noise scales [1]; None without a tag.

    Args:
        residual: Shape (n, streams).
        course: Whose rows.
        noise: Noise so far.
    """
    if course.tag is None:
        return None
    gaps, error = [], []
    for column in (residual[:, -3:] / noise.scale[-3:]).T:
        rows = np.isfinite(column)
        count = np.bincount(course.episode[rows], minlength=course.episodes)
        mean = np.bincount(course.episode[rows], column[rows], minlength=course.episodes) / np.maximum(count, 1)
        pairs = (count[1:] > 2) & (count[:-1] > 2) & (course.site[1:] == course.site[:-1])
        gaps.append(np.diff(mean)[pairs])
        error.append((1 / np.maximum(count[1:], 1) + 1 / np.maximum(count[:-1], 1))[pairs])
    return max(spread_of(np.concatenate(gaps), np.concatenate(error)), 0.2)


def still(noise: Noise, streams: int) -> Noise:
    """Return noise that whitens nothing, so that residuals keep their memory and size."""
    return replace(noise, scale=np.ones(streams), memory=0.0)
