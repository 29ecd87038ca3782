"""Chooses between poses that explain the same corners.

Where only one face was detected, two poses fit its corners. Both are aligned with the image. Their other faces decide
first: a grazing face that no detector reads still correlates with its pattern. Then the grey values decide, and only
then the previous pose, if the caller knows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.alignment import ALIKE, STEPS, Alignment, align
from tacdata.tags.cube.corners import TIGHT, PoseCandidate, angle_between, candidates
from tacdata.tags.cube.cube import AXES, Cube
from tacdata.tags.detection.tag import Tag

UNLIKE = 0.45
"""Correlation [1] below which a face that a pose turns to the camera is missing or covered."""
CLEARLY = 1.15
"""Ratio of residuals [1] from which the better pose is chosen."""
LARGE = 48
"""Side of a tag [px] above which more pixels do not help: from twice that the image is halved, and so on."""
LEAST_TILT = np.radians(6.0)
"""Minimum tilt [rad] for starting the mirrored pose."""
STRIDE, AWAY = np.radians(8.0), 3.0
"""Limits for choosing by the previous pose: largest rotation between two images [rad], and ratio of the farther pose's
distance to the nearer one's [1]. Two poses must be at least twice the first limit apart, and the image must agree as
well as before.
"""
APART = np.radians(2.0)
"""Angle [rad] from which two poses count as different."""


class PoseHypothesis:
    """A pose that explains the detected corners, aligned with the image."""

    def __init__(self, candidate: PoseCandidate, grey: np.ndarray, cube: Cube, camera: PinholeCamera) -> None:
        """Align a candidate with an image, uint8, shape (height, width)."""
        self.tags = candidate.tags
        self.seen = {cube.faces[tag.id] for tag in self.tags}
        start = Alignment(candidate.rotation, candidate.translation)
        self.alignment = _aligned(start, self.seen, grey, cube, camera)
        self.reprojection = candidate.moved(self.alignment.rotation, self.alignment.translation, cube, camera)
        # The image led to another minimum than the corners, which are the safer guide.
        if not self.reprojection <= 1.5 * max(TIGHT * max(tag.size for tag in self.tags), 1.2):
            self.alignment = _aligned(start, self.seen, grey, cube, camera, steps=0)
            self.reprojection = candidate.reprojection
        likeness = self.alignment.likeness
        self.false = [tag for tag in self.tags if likeness.get(cube.faces[tag.id], 0.0) < ALIKE]
        """Tags read where the image does not show them."""

    @property
    def support(self) -> int:
        """Undetected faces that correlate with their pattern."""
        return sum(value > ALIKE for face, value in self.alignment.likeness.items() if face not in self.seen)

    @property
    def missing(self) -> int:
        """Faces that should be visible and are not: missing, or covered."""
        return sum(value < UNLIKE for face, value in self.alignment.likeness.items() if face not in self.seen)


@dataclass(frozen=True, eq=False)
class Before:
    """The cube's pose in the previous image."""

    rotation: np.ndarray
    """From the cube frame to the camera frame [1], shape (3, 3)."""
    residual: float
    """Residual of image and rendering [1]; 0 if two poses were about as good."""


def best_rival(
    tags: list[Tag], grey: np.ndarray, cube: Cube, camera: PinholeCamera, previous: Before | None
) -> tuple[PoseHypothesis, PoseHypothesis | None] | None:
    """Return the pose that the image supports best, and another that it supports about as well, if any.

    Args:
        tags: Tags of the cube with straightened corners [px].
        grey: The image, uint8, shape (height, width).
        cube: The cube.
        camera: The camera.
        previous: The previous pose, if known; decides between equal ones.
    """
    while tags:
        starts = candidates(tags, cube, camera)
        if not starts:
            return None
        start = None if previous is None else _continuing(starts, previous)
        # A pose that continues the image before needs no rival, as long as it explains this image as well.
        if previous is not None and start is not None:
            rival = PoseHypothesis(start, grey, cube, camera)
            if not rival.false and rival.alignment.residual < CLEARLY * previous.residual:
                return rival, None
        rivals = [PoseHypothesis(candidate, grey, cube, camera) for candidate in starts]
        first = rivals[0]
        # One face, and all candidates agree: seen head-on, the mirrored minimum was too near to be found by corners.
        turns = [angle_between(first.alignment.rotation, r.alignment.rotation) for r in rivals]
        if len(first.seen) == 1 and max(turns) < APART:
            rivals = [first, PoseHypothesis(_mirrored(first, cube), grey, cube, camera)]
        best, second = _choose(rivals, previous)
        if not best.false:
            return best, second
        # A tag that was read where the image shows none spoils all candidates: they are solved again without it.
        tags = [tag for tag in tags if not any(tag is false for false in best.false)]
    return None


def _continuing(starts: list[PoseCandidate], previous: Before) -> PoseCandidate | None:
    """Return the pose that continues the previous one, if the other is far from it; None if that is uncertain."""
    angles = sorted((angle_between(start.rotation, previous.rotation), k) for k, start in enumerate(starts))
    if len(angles) < 2 or angles[0][0] > STRIDE or angles[1][0] < AWAY * angles[0][0] + 2 * STRIDE:
        return None
    return starts[angles[0][1]]


def _mirrored(rival: PoseHypothesis, cube: Cube) -> PoseCandidate:
    """Return the pose whose only face is tilted the other way about the line of sight, at the same place.

    For a face seen head-on, noise lets both poses end in one minimum of its four corners, though the image has two.
    """
    rotation, (face,) = rival.alignment.rotation, rival.seen
    normal = rotation @ AXES[face][:, 2]
    centre = rival.alignment.translation + normal * cube.side / 2000
    sight = centre / np.linalg.norm(centre)
    towards = 2 * (normal @ sight) * sight - normal
    axis = np.cross(normal, towards)
    # A minimum tilt, so that the other minimum is in reach.
    angle = np.arctan2(np.linalg.norm(axis), normal @ towards)
    mirror = _turn(axis, max(angle, LEAST_TILT)) @ rotation
    place = centre - mirror @ AXES[face][:, 2] * cube.side / 2000
    return PoseCandidate(mirror, place, rival.tags, rival.reprojection)


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    import cv2

    length = float(np.linalg.norm(axis))
    return cv2.Rodrigues(axis * (angle / length))[0] if length > 1e-9 else np.eye(3)


def _choose(rivals: list[PoseHypothesis], previous: Before | None) -> tuple[PoseHypothesis, PoseHypothesis | None]:
    rivals = [r for r in rivals if not r.false] or rivals
    support = max(rival.support for rival in rivals)
    rivals = sorted((r for r in rivals if r.support == support), key=lambda r: r.alignment.residual)
    best = rivals[0]
    close = [
        r
        for r in rivals
        if r.alignment.residual < CLEARLY * best.alignment.residual
        and angle_between(r.alignment.rotation, best.alignment.rotation) > APART
    ]
    if not close:
        return best, None
    # A missing face speaks against a pose, but may be covered: it decides nothing with certainty.
    equals = sorted([best, *close], key=lambda r: (r.missing, r.alignment.residual))
    if previous is not None:
        equals.sort(key=lambda r: angle_between(r.alignment.rotation, previous.rotation))
    return equals[0], equals[1]


def _aligned(
    start: Alignment, faces: set[str], grey: np.ndarray, cube: Cube, camera: PinholeCamera, steps: int = STEPS
) -> Alignment:
    """Align with a window of the image that holds the whole cube, at half size or less where it is large."""
    half = cube.side / 2000
    box = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = box @ start.rotation.T + start.translation
    if points[:, 2].min() <= 1e-3:
        return start
    pixels = camera.project(points)
    image, matrix = camera.window(grey, pixels.min(axis=0) - 8, pixels.max(axis=0) + 8)
    size = cube.tag / 1000 * camera.matrix[0, 0] / start.translation[2]
    return align(start, faces, cube, *_shrunk(image, matrix, int(size / LARGE)), steps)


def _shrunk(image: np.ndarray, matrix: np.ndarray, factor: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a reduced image and its camera matrix, ``factor`` pixels per side merged; odd rows at the end are lost."""
    import cv2

    height, width = image.shape
    if factor < 2 or min(height, width) < 8 * factor:
        return matrix, image
    window = image[: height // factor * factor, : width // factor * factor]
    small = cv2.resize(window, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    # Pixel centres: a pixel of the small image covers `factor` whole ones.
    shift = (factor - 1) / (2 * factor)
    to_small = np.array([[1 / factor, 0, -shift], [0, 1 / factor, -shift], [0, 0, 1.0]])
    return to_small @ matrix, small
