"""Whether a camera stood still, by the static background of its images: a table, a board, a wall.

Corners of the first image are followed into images spread over the recording. While most of them stay, the camera
stood still. When most of them shift together, and stay so, it was moved. Hands and arms move a minority, and not
together. An empty background has no corners but those of tags and hands, and then nothing is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.demonstrations.paths.camera_bumps import Bump, jumps, split
from tacdata.demonstrations.paths.second_look import sampled
from tacdata.demonstrations.paths.sightings import Sightings
from tacdata.demonstrations.paths.stream_times import timely
from tacdata.demonstrations.recording.reader import DemoRecording
from tacdata.errors import FormatError, UsageError

IMAGES = 48
"""Largest number of images of a camera that are looked at [count]."""
CELLS, A_CELL = (8, 6), 6
"""Cells of an image across and down, and largest number of corners followed in each [count].

Corners of tags and hands are the clearest. Spread evenly, they stay a minority.
"""
SPREAD = 16
"""Smallest number of cells with corners [count]: fewer may be a hand's alone."""
OVER_NOISE = 6.0
"""Smallest clearness of a corner, over the largest of the image's noise [1]. A smooth wall's is 4."""
BLOCK = 9
"""Side of the square over which clearness is averaged [px]. Noise averages out, texture does not."""
FEWEST = 20
"""Smallest number of corners that can still be followed in an image [count]."""
MOST_OF_THEM = 0.5
"""Share of the corners that must stay, or shift together [1]."""
COVERED = 0.3
"""Share of the cells with corners that these must cover [1]. A hand's own cover fewer."""
STILL = 0.5
"""Largest shift of a corner that stays [px]; followed corners scatter by 0.1."""
SHIFTED = 1.5
"""Smallest shift that counts as one of the camera [px]."""
EARLIER, LATER = 50_000_000, 100_000_000
"""Time around the images that show a bump in which its camera may still shake [ns]."""
RETURNED = 1.0
"""Largest error of a corner that is followed there and back [px]."""


@dataclass(frozen=True)
class _Look:
    """One image against the first."""

    time_ns: int
    shift: float | None
    """How far its background is shifted [px]; None if too little of it can be followed."""


def without_bumps(
    sightings: Mapping[str, Sightings], recording: DemoRecording, delays: Mapping[str, float]
) -> tuple[dict[str, Sightings], list[str]]:
    """Return sightings in which a camera that was moved is another one from then on, and sentences about it.

    The background decides between two cameras where the fingers' motion does not.

    Args:
        sightings: Finger -> its sightings.
        recording: The demonstration.
        delays: Camera -> by how much its images were moved back in time [s]; missing for 0.
    """
    image_bumps = shifts(recording, delays)
    sighting_bumps = jumps({name: timely(series) for name, series in sightings.items()}, recording.span_ns[0])
    if image_bumps:
        cameras = {bump.camera for bump in image_bumps}
        rivals = {
            bump.begin_ns: {b.camera for b in sighting_bumps if b.begin_ns == bump.begin_ns} for bump in sighting_bumps
        }
        # A bump seen in the background is reported once, and rules out the other camera of the pair.
        sighting_bumps = [bump for bump in sighting_bumps if not rivals[bump.begin_ns] & cameras]
    bumps = sorted([*image_bumps, *sighting_bumps], key=lambda bump: bump.begin_ns)
    return split(sightings, bumps), [bump.words for bump in bumps]


def shifts(recording: DemoRecording, delays: Mapping[str, float]) -> list[Bump]:
    """Return the bumps that show in the background of the stored images, by their time.

    Args:
        recording: The demonstration; if its file is gone or damaged, nothing is known.
        delays: Camera -> by how much its images were moved back in time [s].
    """
    bumps: list[Bump] = []
    images: Mapping[str, list[tuple[int, np.ndarray]]] = {}
    with suppress(UsageError, FormatError):
        images = sampled(recording, IMAGES)
    begin = recording.span_ns[0]
    for camera, looked in images.items():
        scale = _scale(recording, camera)
        if scale is not None and looked:
            delay = round(delays.get(camera, 0.0) * 1e9)
            bumps += _bumps(camera, _followed([(time - delay, image) for time, image in looked]), scale, begin)
    return sorted(bumps, key=lambda bump: bump.begin_ns)


def _scale(recording: DemoRecording, camera: str) -> float | None:
    """Return the size of a pixel at the fingers [m]; None if the camera saw none, or has no intrinsics."""
    intrinsics = recording.rig.cameras[camera].get("intrinsics")
    distances = [view.position[view.faces > 0, 2] for view in recording.views if view.camera == camera]
    ranges = np.concatenate(distances) if distances else np.zeros(0)
    ranges = ranges[np.isfinite(ranges)]
    return float(np.median(ranges)) / intrinsics["fx"] if intrinsics and len(ranges) else None


def _followed(images: list[tuple[int, np.ndarray]]) -> list[_Look]:
    import cv2

    first = images[0][1]
    corners = _corners(first)
    if len(corners) < FEWEST:
        return []
    looks, coverage = [_Look(images[0][0], 0.0)], COVERED * _cells(corners[:, 0], first.shape)
    lk: dict[str, Any] = {"winSize": (21, 21), "maxLevel": 4}
    for time, image in images[1:]:
        if image.shape != first.shape:
            continue
        positions, status, _ = cv2.calcOpticalFlowPyrLK(first, image, corners, None, **lk)  # ty: ignore[no-matching-overload]
        # Followed there and back: a corner that a hand covers meanwhile does not return to its place.
        back, back_status, _ = cv2.calcOpticalFlowPyrLK(image, first, positions, None, **lk)  # ty: ignore[no-matching-overload]
        mask = (status.ravel() > 0) & (back_status.ravel() > 0)
        mask &= np.linalg.norm((back - corners)[:, 0], axis=1) < RETURNED
        looks.append(_Look(time, _shift(corners[mask, 0], positions[mask, 0], coverage, first.shape)))
    return looks


def _corners(image: np.ndarray) -> np.ndarray:
    """Return corners spread over an image and clearer than its noise [px], shape (n, 1, 2), float32.

    The array is empty if they do not spread.
    """
    import cv2

    clear = cv2.cornerMinEigenVal(image, BLOCK)
    grey = image.astype(np.float32)
    detail = np.asarray(grey - cv2.GaussianBlur(grey, (0, 0), 1.0), np.float32)
    noise = 1.4826 * float(np.median(np.abs(detail - np.median(detail))))
    # The gradient energy that noise of this size produces on a grey wall.
    wall = 128 + noise * np.random.default_rng(0).standard_normal((128, 128))
    threshold = OVER_NOISE * float(cv2.cornerMinEigenVal(np.clip(np.rint(wall), 0, 255).astype(np.uint8), BLOCK).max())
    groups = []
    for rows in np.array_split(np.arange(image.shape[0]), CELLS[1]):
        for columns in np.array_split(np.arange(image.shape[1]), CELLS[0]):
            top, left = rows[0], columns[0]
            cell = clear[top : rows[-1] + 1, left : columns[-1] + 1]
            highest = float(cell.max())
            if highest < threshold:
                continue
            tile = np.ascontiguousarray(image[top : rows[-1] + 1, left : columns[-1] + 1])
            # OpenCV takes the threshold as a share of the cell's clearest corner.
            corners = cv2.goodFeaturesToTrack(
                tile, A_CELL, min(max(threshold / highest, 0.02), 1.0), 8, blockSize=BLOCK
            )
            if corners is not None:
                groups.append(corners + np.array([left, top], np.float32))
    return np.concatenate(groups).astype(np.float32) if len(groups) >= SPREAD else np.zeros((0, 1, 2), np.float32)


def _cells(corners: np.ndarray, shape: tuple[int, ...]) -> int:
    """Return how many cells of an image of a shape hold corners [px], shape (n, 2)."""
    size = np.array([shape[1] / CELLS[0], shape[0] / CELLS[1]])
    return len(np.unique((corners / size).astype(int), axis=0))


def _shift(start: np.ndarray, end: np.ndarray, coverage: float, shape: tuple[int, ...]) -> float | None:
    """Return how far most corners shifted together [px]; 0 if most of them stay, None if neither.

    Args:
        start: Corners in the first image [px], shape (n, 2).
        end: The same, followed into another, shape (n, 2).
        coverage: Smallest number of cells of the image that they must cover [count].
        shape: The image's.
    """
    import cv2

    if len(start) < FEWEST:
        return None
    displacement = np.linalg.norm(end - start, axis=1) < STILL
    if displacement.mean() >= MOST_OF_THEM and _cells(start[displacement], shape) >= coverage:
        return 0.0
    # Shift, turn and scale: all that a small motion of a camera does to a distant background.
    transform, inside = cv2.estimateAffinePartial2D(start, end, ransacReprojThreshold=1.0)
    together = inside.ravel() > 0
    if transform is None or together.mean() < MOST_OF_THEM or _cells(start[together], shape) < coverage:
        return None
    return float(np.median(np.linalg.norm((end - start)[together], axis=1)))


def _bumps(camera: str, looks: list[_Look], scale: float, begin_ns: int) -> list[Bump]:
    """Return a camera's bumps: stretches of at least two images whose background has the same shift."""
    views = [look for look in looks if look.shift is not None]
    runs: list[list[_Look]] = []
    for look in views:
        if runs and abs((look.shift or 0.0) - (runs[-1][0].shift or 0.0)) < SHIFTED:
            runs[-1].append(look)
        else:
            runs.append([look])
    # A single image may be covered by a hand or an arm.
    runs = [run for run in runs if len(run) > 1]
    bumps = []
    for previous_run, run, next_run in zip(runs, runs[1:], [*runs[2:], None], strict=False):
        shift = run[0].shift or 0.0
        if shift < SHIFTED:
            continue
        # It may have happened right after the last image that shows the place before, and ended right before the next.
        first, last = previous_run[-1].time_ns, None if next_run is None else next_run[0].time_ns
        end = run[0].time_ns
        between = f"between {(first - begin_ns) * 1e-9:.1f} and {(end - begin_ns) * 1e-9:.1f} s"
        until = "" if last is None else f", until {(last - begin_ns) * 1e-9:.1f} s"
        words = (
            f"camera {camera} was moved {between} after the beginning{until}: what stands still in its images is "
            f"shifted by {shift:.1f} px, {1000 * shift * scale:.1f} mm at the fingers"
        )
        bumps.append(Bump(camera, first - EARLIER, end + LATER, last, shift * scale, words))
    return bumps
