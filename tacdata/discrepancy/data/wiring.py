"""Whether the channels are those that the model takes them for: swapped, mirrored, turned around or inverted."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from tacdata.chain import Course, Response, predict
from tacdata.discrepancy.data.streams import Streams

FEWEST_TOUCHING = 40
"""Wiring: readings in contact that are needed."""
BETTER = 0.15
"""Wiring: another channel must correlate better by this much [1]."""
POOR = 0.85
"""Wiring: a channel that correlates with its own prediction so well is the right one [1]."""
INVERTED = -0.6
"""Wiring: below this correlation a channel is inverted [1]."""
TURNS = {"mirrored along x": (-1, 1), "mirrored along y": (1, -1), "turned by 180 degrees": (-1, -1)}
"""Possible change of a whole array -> resulting x and y."""
LEAST_MOTION = 0.02
"""Wiring: channels that move by a smaller share of the largest are not checked [1]."""


def miswired(course: Course, response: Response) -> list[str]:
    """Return in words which channels are not those of the model; nothing for a response fitted to the recordings.

    Args:
        course: The recordings.
        response: Without effects.
    """
    if response.fitted or course.channels < 2:
        return []
    predicted = Streams.of(course).rise(predict(course, response, []), response)[:, : course.channels]
    touched = np.abs(predicted).max(axis=1) > LEAST_MOTION * np.abs(predicted).max()
    if touched.sum() < FEWEST_TOUCHING:
        return []
    read = course.reduced.readings[touched] - np.median(course.reduced.readings[~touched], axis=0)
    predicted = predicted[touched]
    active = np.abs(predicted).max(axis=0) > LEAST_MOTION * np.abs(predicted).max()
    likeness = _likeness(read, predicted)
    likeness[:, ~active] = 0.0
    diagonal = np.diag(likeness)
    inverted = [int(k) for k in np.flatnonzero(active & (diagonal < INVERTED))]
    words = [f"{course.channel_names[k]} reads the other way round: turn its sign" for k in inverted]
    likeness[inverted] = np.abs(likeness[inverted])
    # One-to-one, not the best for each channel: two channels of similar readings would both claim the same prediction.
    _, best = linear_sum_assignment(-likeness)
    diagonal = np.diag(likeness)
    mismatched = [
        k
        for k in range(course.channels)
        if active[k] and active[best[k]] and diagonal[k] < POOR and likeness[k, best[k]] > diagonal[k] + BETTER
    ]
    return words + (_in_words(mismatched, best, course) if mismatched else [])


def _likeness(read: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return the cosine of every reading with every prediction, shape (channels, channels)."""
    read_size = np.maximum(np.linalg.norm(read, axis=0), 1e-12)
    predicted_size = np.maximum(np.linalg.norm(predicted, axis=0), 1e-12)
    return (read / read_size).T @ (predicted / predicted_size)


def _in_words(mismatched: list[int], best: np.ndarray, course: Course) -> list[str]:
    centers, number = course.centers, course.numbers or range(course.channels)
    if centers is not None:
        middle = centers.mean(axis=0)
        for turn, sign in (
            ("mirrored along x", (-1, 1)),
            ("mirrored along y", (1, -1)),
            ("turned by 180 degrees", (-1, -1)),
        ):
            mirrored = middle + (centers - middle) * sign
            mirror = np.argmin(np.linalg.norm(centers[None] - mirrored[:, None], axis=2), axis=1)
            if len(mismatched) > 3 and np.mean(mirror[mismatched] == best[mismatched]) > 0.7:
                return [f"the channels are {turn}: correct the order of channels, or how the sensor lies"]
    pairs = sorted({(min(k, int(best[k])), max(k, int(best[k]))) for k in mismatched if best[best[k]] == k})
    single = [k for k in mismatched if best[best[k]] != k]
    words = [f"channels {number[a]} and {number[b]} look swapped: check their wires" for a, b in pairs]
    return words + [
        f"channel {number[k]} reads what channel {number[int(best[k])]} should: check the order of channels"
        for k in single
    ]
