"""A cube's pose in an image: tags, then corners, then grey values.

Where one face is all that was detected, two poses fit its corners. Both are aligned with the image; what
their other faces should look like decides (a grazing face that no detector reads still correlates with its
pattern), then how well the grey values agree, and only then, if the caller knows it, the pose just before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.tags.alignment import ALIKE, STEPS, Alignment, align
from tacdata.tags.camera import Camera
from tacdata.tags.corners import TIGHT, Candidate, angle_between, candidates
from tacdata.tags.cube import Cube
from tacdata.tags.detector import detect_tags, to_grey
from tacdata.tags.tag import Tag

UNLIKE = 0.45
"""Correlation [1] below which a face that a pose turns to the camera is not there (or is covered)."""
CLEARLY = 1.15
"""Ratio of residuals [1] from which the better one is believed."""


@dataclass(frozen=True, eq=False)
class CubePose:
    """Where a cube is in the camera frame (x right, y down, z forward)."""

    position: np.ndarray
    """The cube's centre [m], shape (3,)."""
    quaternion: np.ndarray
    """Rotation from the cube frame to the camera frame, xyzw [1], shape (4,)."""
    reprojection: float
    """Root mean square distance of the detected corners from where the pose puts them [px]."""
    faces: int
    """Faces detected [count]."""
    ids: tuple[int, ...]
    """Their tag numbers, ascending."""
    ambiguous: bool = False
    """Whether a second pose fits the image about as well."""

    @property
    def matrix(self) -> np.ndarray:
        """The cube frame in the camera frame, homogeneous, shape (4, 4) [m]."""
        from scipy.spatial.transform import Rotation

        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(self.quaternion).as_matrix()
        matrix[:3, 3] = self.position
        return matrix


def detect_cube(
    image: np.ndarray, intrinsics: dict[str, Any], cube: dict[str, Any], hint: CubePose | None = None
) -> CubePose | None:
    """Return the pose of a cube, or None if no tag of it is seen.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        intrinsics: A rig file's ``intrinsics`` [px].
        cube: A rig file's ``cube`` [mm].
        hint: The pose just before, if known: decides only where the image does not.

    Raises:
        UsageError: If the image is no image or of another size than the intrinsics.
        FormatError: If intrinsics or cube contradict themselves.
    """
    grey, camera, known = to_grey(image), Camera.from_document(intrinsics), Cube.from_document(cube)
    camera.check(grey)
    tags = [
        Tag(tag.id, camera.straighten(tag.corners), tag.margin, tag.hamming)
        for tag in detect_tags(grey, whole=False)
        if tag.id in known.faces
    ]
    while tags:
        rivals = [_Rival(c, grey, known, camera) for c in candidates(tags, known, camera)]
        if not rivals:
            return None
        best = _choose(rivals, hint)
        if not best.false:
            return best.finished()
        tags = [tag for tag in tags if not any(tag is other for other in best.false)]
    return None


class _Rival:
    """A pose that explains the detected corners, aligned with the image."""

    def __init__(self, candidate: Candidate, grey: np.ndarray, cube: Cube, camera: Camera) -> None:
        self.tags = candidate.tags
        self.seen = {cube.faces[tag.id] for tag in self.tags}
        start = Alignment(candidate.rotation, candidate.translation)
        self.alignment = _aligned(start, self.seen, grey, cube, camera)
        self.reprojection = candidate.moved(self.alignment.rotation, self.alignment.translation, cube, camera)
        if not self.reprojection <= 1.5 * max(TIGHT * max(tag.size for tag in self.tags), 1.2):
            self.alignment = _aligned(start, self.seen, grey, cube, camera, steps=0)
            self.reprojection = candidate.reprojection
        self.ambiguous = False
        likeness = self.alignment.likeness
        self.false = [tag for tag in self.tags if likeness.get(cube.faces[tag.id], 0.0) < ALIKE]
        """Tags read where the image does not show them."""

    @property
    def support(self) -> int:
        """Faces that look as they should, beyond those detected, less those that do not."""
        others = [value for face, value in self.alignment.likeness.items() if face not in self.seen]
        return sum(value > ALIKE for value in others) - sum(value < UNLIKE for value in others)

    def finished(self) -> CubePose:
        from scipy.spatial.transform import Rotation

        ids = tuple(sorted(tag.id for tag in self.tags))
        quaternion = Rotation.from_matrix(self.alignment.rotation).as_quat()
        position = self.alignment.translation.copy()
        return CubePose(position, quaternion, float(self.reprojection), len(ids), ids, self.ambiguous)


def _aligned(
    start: Alignment, seen: set[str], grey: np.ndarray, cube: Cube, camera: Camera, steps: int = STEPS
) -> Alignment:
    """Align with a window of the image that holds the whole cube."""
    half = cube.side / 2000
    box = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    points = box @ start.rotation.T + start.translation
    if points[:, 2].min() <= 1e-3:
        return start
    pixels = camera.project(points)
    image, matrix = camera.window(grey, pixels.min(axis=0) - 8, pixels.max(axis=0) + 8)
    return align(start, seen, cube, matrix, image, steps)


def _choose(rivals: list[_Rival], hint: CubePose | None) -> _Rival:
    """Return the pose that the image supports best; mark it if it does so hardly better than another."""
    rivals = [r for r in rivals if not r.false] or rivals
    most = max(rival.support for rival in rivals)
    rivals = sorted((r for r in rivals if r.support == most), key=lambda r: r.alignment.residual)
    best = rivals[0]
    close = [
        r for r in rivals
        if r.alignment.residual < CLEARLY * best.alignment.residual
        and angle_between(r.alignment.rotation, best.alignment.rotation) > np.radians(2.0)
    ]
    if close and hint is not None:
        turned = hint.matrix[:3, :3]
        best = min([best, *close], key=lambda r: angle_between(r.alignment.rotation, turned))
    best.ambiguous = bool(close)
    return best
