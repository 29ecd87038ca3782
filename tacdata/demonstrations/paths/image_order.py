"""Images that arrived in the wrong order and have no stamps, by the motion that they show.

Two neighbours that are exchanged make every finger go to and fro. Exchanged again, they lie on a smooth path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tacdata.demonstrations.paths.sightings import Sightings
from tacdata.demonstrations.paths.stream_times import added

EVEN = 0.3
"""Largest deviation of the intervals of four images from the usual one [1]."""
CLEARLY = 40.0
"""Fall of the squared second differences by an exchange, over their covariance and summed over the fingers, from which
two images are exchanged [1]; in order, noise leaves 18 with a deviation of 6.
"""
ROUGHER = 4.0
"""Ratio of the squared second differences as they arrived, and exchanged, that this asks for [1]."""
WITHIN = 3.0
"""Standard deviations that hold an image whose exchange was not noticed, as little moved in it: a period [1]."""


def in_order(sightings: Mapping[str, Sightings]) -> tuple[dict[str, Sightings], list[str]]:
    """Return sightings without images that two neighbours' exchange explains, and words about it.

    The times of the other images of that camera are as uncertain as an exchange.

    Args:
        sightings: Finger -> its sightings.
    """
    squares: dict[tuple[str, int, int], np.ndarray] = {}
    for series in sightings.values():
        for camera in dict.fromkeys(series.camera):
            rows = np.flatnonzero([name == camera for name in series.camera])
            for first, second, both in _squares(series, rows):
                pair = camera, first, second
                squares[pair] = squares.get(pair, np.zeros(2)) + both
    wrong = [
        pair
        for pair, (arrived, exchanged) in squares.items()
        # Both a difference and a ratio: at rest either order is smooth, and in fast motion either is rough.
        if arrived - exchanged > CLEARLY and arrived > ROUGHER * exchanged
    ]
    if not wrong:
        return dict(sightings), []
    cameras = dict.fromkeys(camera for camera, _, _ in wrong)
    moments = {(camera, time) for camera, *times in wrong for time in times}
    judged = {}
    for name, series in sightings.items():
        timing = series.timing.copy()
        for camera in cameras:
            rows = np.array([seen_by == camera for seen_by in series.camera], bool)
            if rows.sum() > 1:
                period = float(np.median(np.diff(series.time_ns[rows]))) * 1e-9
                timing[rows] = np.maximum(timing[rows], period / WITHIN)
        unsure = replace(series, timing=timing, covariance=series.covariance + added(series, timing))
        images = zip(series.camera, series.time_ns.tolist(), strict=True)
        judged[name] = unsure.where(np.array([image not in moments for image in images], bool))
    return judged, [
        f"{sum(pair[0] == camera for pair in wrong)} times two images of camera {camera} arrived in the wrong order, "
        "by the motion that they show: they are left out, and the others are known to a period; record with a camera "
        "that stamps its images"
        for camera in cameras
    ]


def _squares(series: Sightings, rows: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Return pairs of neighbouring images of one camera, by their times [ns].

    Each has the squared second differences about it over their covariance, as they arrived and exchanged [1].
    """
    if len(rows) < 4:
        return []
    times, places = series.time_ns[rows], series.position[rows]
    # Weights 1, -2 and 1 of three places each.
    whitening = np.linalg.inv(np.linalg.cholesky(6 * series.covariance[rows][:, 3:, 3:]))
    quadruples = np.arange(len(rows) - 3)[:, None] + np.arange(4)
    intervals = np.diff(times[quadruples], axis=1) / float(np.median(np.diff(times)))
    even = (np.abs(intervals - 1) < EVEN).all(axis=1)

    def roughness(order: list[int]) -> np.ndarray:
        path = places[quadruples[:, order]]
        # Second differences: a motion of constant speed has none, whatever its speed.
        second = path[:, :-2] - 2 * path[:, 1:-1] + path[:, 2:]
        return (np.einsum("nij,nkj->nki", whitening[quadruples[:, 1]], second) ** 2).sum(axis=(1, 2))

    both = np.stack([roughness([0, 1, 2, 3]), roughness([0, 2, 1, 3])], axis=1)
    return [(int(times[k + 1]), int(times[k + 2]), both[k]) for k in np.flatnonzero(even)]
