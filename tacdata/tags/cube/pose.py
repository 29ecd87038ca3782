"""Estimates a cube's pose in an image: from tags, then corners, then grey values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.corners import contradicting
from tacdata.tags.cube.cube import Cube
from tacdata.tags.cube.rivals import Before, PoseHypothesis, best_rival
from tacdata.tags.detection.detector import detect_tags, to_grey
from tacdata.tags.detection.tag import Tag

AROUND = 2.0
"""Size of the search region around the previous pose, in sides of the cube [1]."""


@dataclass(frozen=True, eq=False)
class CubePose:
    """Pose of a cube in the camera frame (x right, y down, z forward)."""

    position: np.ndarray
    """The cube's centre [m], shape (3,)."""
    quaternion: np.ndarray
    """Rotation from the cube frame to the camera frame, xyzw [1], shape (4,)."""
    reprojection: float
    """Root mean square reprojection error of the detected corners [px]."""
    faces: int
    """Faces detected [count]."""
    ids: tuple[int, ...]
    """Their tag numbers, ascending."""
    ambiguous: bool = False
    """Whether a second pose fits the image about as well."""
    covariance: np.ndarray = field(default_factory=lambda: np.full((6, 6), np.inf))
    """Covariance of a small rotation in the camera frame [rad] and the position [m], in this order, shape (6, 6). It
    covers image noise. It does not cover calibration errors, the print's scale or a wrong choice between ambiguous
    poses.
    """
    residual: float = 0.0
    """Difference of image and rendered tags over the contrast of black and white [1]; about 0.02 in a sharp image."""
    rival: CubePose | None = None
    """The other pose, where `ambiguous`."""
    strays: tuple[int, ...] = ()
    """Outlier tags of this cube: read where the pose has no such tag (swapped tags, or another cube's)."""

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
        hint: The previous pose, if known. It is searched first, and decides between ambiguous poses.

    Raises:
        UsageError: If the image is invalid or of another size than the intrinsics.
        FormatError: If intrinsics or cube contradict themselves.

    Example:
        >>> import numpy as np
        >>> from scipy.spatial.transform import Rotation
        >>> from tacdata.tags import detect_cube
        >>> from tacdata.virtual_rig.optics.render import render_cube
        >>> intrinsics = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0}
        >>> cube = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}
        >>> true = np.eye(4)  # a cube 0.2 m away
        >>> true[:3, :3] = Rotation.from_euler("xyz", [150, 20, 10], degrees=True).as_matrix()
        >>> true[:3, 3] = [0.01, 0.0, 0.2]
        >>> image = render_cube(true, intrinsics, cube, np.random.default_rng(0))
        >>> pose = detect_cube(image, intrinsics, cube)
        >>> pose.ids, pose.ambiguous
        ((3, 4), False)
        >>> bool(np.linalg.norm(pose.position - true[:3, 3]) < 1e-4)  # m
        True
    """
    grey, camera, geometry = to_grey(image), PinholeCamera.from_document(intrinsics), Cube.from_document(cube)
    camera.check(grey)
    near = None if hint is None else surroundings(hint, geometry, camera)
    # Near the previous pose first; a cube that has moved away is searched for in the whole image.
    for within in (near, None) if near else (None,):
        pose = solve_cube(grey, detect_tags(grey, whole=False, within=within), geometry, camera, hint)
        if pose is not None:
            return pose
    return None


def solve_cube(
    grey: np.ndarray, tags: list[Tag], cube: Cube, camera: PinholeCamera, hint: CubePose | None = None
) -> CubePose | None:
    """Return the pose of a cube from tags that were read in an image, or None if none of them is the cube's.

    Args:
        grey: The image, uint8, shape (height, width).
        tags: Tags as read [px of the image as taken].
        cube: The cube.
        camera: The camera.
        hint: The previous pose, if known; decides only between ambiguous poses.
    """
    cube_tags = [
        Tag(tag.id, camera.straighten(tag.corners), tag.margin, tag.hamming) for tag in tags if tag.id in cube.faces
    ]
    previous = None
    if hint is not None:
        # No residual is clearly below 0: after an ambiguous pose all candidates are compared again.
        previous = Before(hint.matrix[:3, :3], 0.0 if hint.ambiguous else hint.residual)
    pair = best_rival(cube_tags, grey, cube, camera, previous)
    if pair is None:
        return None
    best, rival = pair
    # By identity: two tags of one image may have the same number.
    used, aligned = {id(tag) for tag in best.tags}, best.alignment
    remainder = [tag for tag in cube_tags if id(tag) not in used]
    away = contradicting(remainder, aligned.rotation, aligned.translation, cube, camera)
    strays = tuple(sorted({tag.id for tag in away}))
    return _pose(best, strays, None if rival is None else _pose(rival, strays, None))


def surroundings(pose: CubePose, cube: Cube, camera: PinholeCamera) -> tuple[int, int, int, int] | None:
    """Return left, top, right, bottom [px] of where the cube will soon be; None if out of the image."""
    if pose.position[2] <= cube.side / 1000:
        return None
    centre = camera.bend(camera.project(pose.position[None]))[0]
    # Half the diagonal of a cube is 0.87 of its side.
    reach = (0.9 + AROUND) * cube.side / 1000 * camera.matrix[0, 0] / pose.position[2]
    low, high = np.floor(centre - reach).astype(int), np.ceil(centre + reach).astype(int)
    left, top = np.maximum(low, 0)
    right, bottom = np.minimum(high, [camera.width, camera.height])
    return (int(left), int(top), int(right), int(bottom)) if right > left and bottom > top else None


def _pose(rival: PoseHypothesis, strays: tuple[int, ...], second: CubePose | None) -> CubePose:
    from scipy.spatial.transform import Rotation

    ids = tuple(sorted(tag.id for tag in rival.tags))
    aligned = rival.alignment
    return CubePose(
        position=aligned.translation.copy(),
        quaternion=Rotation.from_matrix(aligned.rotation).as_quat(),
        reprojection=float(rival.reprojection),
        faces=len(ids),
        ids=ids,
        ambiguous=second is not None,
        covariance=aligned.covariance,
        residual=aligned.residual,
        rival=second,
        strays=strays,
    )
