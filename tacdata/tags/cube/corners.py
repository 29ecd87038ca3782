"""Poses of a cube that explain the corners of its tags.

Every tag alone gives two poses: in weak perspective a square looks the same tilted either way (Collins & Bartoli,
"Infinitesimal plane-based pose estimation", IJCV 109, 2014). All corners together give one. A pose is refined by
Gauss-Newton steps (OpenCV's VVS) on its inlier tags, first with a loose limit, then with a tight one; the others are
outliers.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.cube import AXES, Cube
from tacdata.tags.detection.tag import Tag

LOOSE, TIGHT = 0.35, 0.06
"""Inlier limits: reprojection error of a tag's corners over its size [1], for a first and for a refined pose."""
LEAST = 1.2
"""Reprojection error that is always allowed [px]: four times a corner's noise."""


@dataclass(frozen=True, eq=False)
class PoseCandidate:
    """A pose and the tags that it explains."""

    rotation: np.ndarray
    """From the cube frame to the camera frame [1], shape (3, 3)."""
    translation: np.ndarray
    """Cube centre in the camera frame [m], shape (3,)."""
    tags: tuple[Tag, ...]
    """Tags explained, one per face."""
    reprojection: float
    """Root mean square reprojection error of their corners [px]."""

    def moved(self, rotation: np.ndarray, translation: np.ndarray, cube: Cube, camera: PinholeCamera) -> float:
        """Return the reprojection error [px] of the same tags at another pose."""
        errors = [_error(rotation, translation, tag, cube, camera) for tag in self.tags]
        return float(np.sqrt(np.mean(np.square(errors))))


def candidates(tags: list[Tag], cube: Cube, camera: PinholeCamera) -> list[PoseCandidate]:
    """Return the different poses that explain the most tags, best first; none without tags.

    Args:
        tags: Tags of the cube with straightened corners.
        cube: The cube.
        camera: The camera.
    """
    poses: list[PoseCandidate] = []
    several = len({tag.id for tag in tags}) > 1
    # The largest first: its corners determine the pose best, and the search may end with it.
    for tag in sorted(tags, key=lambda tag: -tag.size):
        for candidate in _solved(tag, tags, cube, camera):
            poses.append(candidate)
            if several and len(candidate.tags) == len(tags) and candidate.reprojection < LEAST:
                return [candidate]  # several faces allow one pose only
    support = max((len(c.tags) for c in poses), default=0)
    distinct: list[PoseCandidate] = []
    for candidate in sorted((c for c in poses if len(c.tags) == support), key=lambda c: c.reprojection):
        if all(angle_between(candidate.rotation, rival.rotation) > np.radians(2.0) for rival in distinct):
            distinct.append(candidate)
    return distinct


def contradicting(
    tags: list[Tag], rotation: np.ndarray, translation: np.ndarray, cube: Cube, camera: PinholeCamera
) -> list[Tag]:
    """Return the tags that lie elsewhere than a pose predicts.

    A tag that is merely read badly, for example at a slant, is not included.

    Args:
        tags: Tags of the cube with straightened corners, not among those that gave the pose.
        rotation: From the cube frame to the camera frame [1], shape (3, 3).
        translation: Cube centre in the camera frame [m], shape (3,).
        cube: The cube.
        camera: The camera.
    """
    import cv2

    near = _fitting(cv2.Rodrigues(rotation)[0], translation.reshape(3, 1), tags, cube, camera, LOOSE)
    return [tag for tag in tags if not any(tag is neighbour for neighbour in near)]


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle [rad] between two rotations, shape (3, 3)."""
    return float(np.arccos(np.clip(((a * b).sum() - 1) / 2, -1.0, 1.0)))


def _solved(start: Tag, tags: list[Tag], cube: Cube, camera: PinholeCamera) -> Iterator[PoseCandidate]:
    """Yield the two poses of one tag, each refined on all its inliers."""
    import cv2

    points, pixels = _pairs([start], cube)
    # A planar square has two poses of nearly equal error (Schweighofer and Pinz 2006); this method gives both.
    method = cv2.SOLVEPNP_IPPE
    try:
        _, rotations, translations, _ = cv2.solvePnPGeneric(points, pixels, camera.matrix, None, flags=method)
    except cv2.error:  # collinear corners, from a false detection
        return
    for rotation, translation in zip(rotations, translations, strict=True):
        candidate = _settle(rotation, translation, tags, cube, camera)
        if candidate is not None:
            yield candidate


def _settle(
    rotation: np.ndarray, translation: np.ndarray, tags: list[Tag], cube: Cube, camera: PinholeCamera
) -> PoseCandidate | None:
    """Refine a pose (rotation vector [rad] and translation [m]) on its inlier tags; None if there are none."""
    import cv2

    # From one tag the others are predicted badly. Loosely first, then with all tags found.
    for limit in (LOOSE, TIGHT):
        group = _fitting(rotation, translation, tags, cube, camera, limit)
        if not group:
            return None
        try:
            # OpenCV writes into the arrays that it is given.
            rotation, translation = cv2.solvePnPRefineVVS(
                *_pairs(group, cube), camera.matrix, None, rotation.copy(), translation.copy()
            )
        except cv2.error:
            return None
    group = _fitting(rotation, translation, tags, cube, camera, TIGHT)
    if not group:
        return None
    square, place = cv2.Rodrigues(rotation)[0], translation.ravel()
    errors = [_error(square, place, tag, cube, camera) for tag in group]
    return PoseCandidate(square, place, tuple(group), float(np.sqrt(np.mean(np.square(errors)))))


def _fitting(
    rotation: np.ndarray, translation: np.ndarray, tags: list[Tag], cube: Cube, camera: PinholeCamera, limit: float
) -> list[Tag]:
    """Return the inlier tags, one per id, whose faces a pose turns to the camera."""
    import cv2

    if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
        return []
    square, place = cv2.Rodrigues(rotation)[0], translation.ravel()
    inliers: dict[int, tuple[float, Tag]] = {}
    for tag in tags:
        outward = square @ AXES[cube.faces[tag.id]][:, 2]
        # Behind the camera, or a face seen from within the cube.
        if place[2] <= 0 or outward @ (place + outward * cube.side / 2000) >= 0:
            continue
        error = _error(square, place, tag, cube, camera)
        if error <= max(limit * tag.size, LEAST) and (tag.id not in inliers or error < inliers[tag.id][0]):
            inliers[tag.id] = (error, tag)
    return [tag for _, tag in inliers.values()]


def _error(rotation: np.ndarray, translation: np.ndarray, tag: Tag, cube: Cube, camera: PinholeCamera) -> float:
    """Return the root mean square reprojection error [px] of a tag's corners."""
    points = cube.corners(cube.faces[tag.id]) @ rotation.T + translation
    return float(np.sqrt(((camera.project(points) - tag.corners) ** 2).sum(axis=1).mean()))


def _pairs(tags: list[Tag], cube: Cube) -> tuple[np.ndarray, np.ndarray]:
    """Return corners in the cube frame [m], shape (n, 3), and in the image [px], shape (n, 2)."""
    points = np.concatenate([cube.corners(cube.faces[tag.id]) for tag in tags])
    return points, np.concatenate([tag.corners for tag in tags]).astype(float)
