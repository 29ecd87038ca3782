"""Fingertips in an image, from the poses of the fingers' cubes."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from tacdata.tags.camera import PinholeCamera
from tacdata.tags.cube.pose import CubePose, detect_cube, solve_cube
from tacdata.tags.detection.detector import detect_tags, to_grey
from tacdata.tags.detection.tag import Tag
from tacdata.tags.fingers import Finger, fingers_of
from tacdata.tags.mixups import mixups


@dataclass(frozen=True, eq=False)
class TipPose:
    """Pose of a fingertip in the camera frame (x right, y down, z forward)."""

    position: np.ndarray
    """Origin of the fingertip's frame [m], shape (3,)."""
    quaternion: np.ndarray
    """Rotation from the fingertip's frame to the camera frame, xyzw [1], shape (4,)."""
    covariance: np.ndarray
    """Covariance of a small rotation in the camera frame [rad] and the position [m], in this order, shape (6, 6)."""
    cube: CubePose
    """The cube's pose that it is computed from."""


@dataclass(frozen=True, eq=False)
class View:
    """Fingertips seen in one image."""

    tips: dict[str, TipPose]
    """Name of each finger that is seen -> its tip."""
    tags: tuple[Tag, ...] = ()
    """All tags read, of whatever number."""
    remarks: tuple[str, ...] = field(default=())
    """Warnings about tags or cubes that seem to be swapped."""

    @property
    def cubes(self) -> dict[str, CubePose]:
        """Name of each finger that is seen -> its cube's pose."""
        return {name: tip.cube for name, tip in self.tips.items()}


def detect_fingers(
    image: np.ndarray, intrinsics: dict[str, Any], fingers: dict[str, Finger], hints: dict[str, CubePose] | None = None
) -> View:
    """Return the fingertips in an image; a finger needs one readable tag.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        intrinsics: A rig file's ``intrinsics`` [px].
        fingers: The fingers, from `read_fingers`.
        hints: Previous poses of the cubes, by finger; decide only between ambiguous poses.

    Raises:
        UsageError: If the image is invalid or of another size than the intrinsics.
        FormatError: If the intrinsics contradict themselves.
    """
    grey, camera = to_grey(image), PinholeCamera.from_document(intrinsics)
    camera.check(grey)
    return view_of(grey, detect_tags(grey, whole=False), camera, fingers, hints or {})


def look(image: np.ndarray, intrinsics: dict[str, Any], what: dict[str, Any], hint: Any = None) -> Any:
    """Return the sightings, in an image, of a rig file's ``cube`` or ``fingers``.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        intrinsics: A rig file's ``intrinsics`` [px].
        what: A cube's or a fingers' document.
        hint: Previous pose of the cube, or of the cubes by finger.

    Returns:
        `CubePose` or None of a cube, `View` of fingers.

    Raises:
        UsageError: If the image is invalid or of another size than the intrinsics.
        FormatError: If a document contradicts itself.
    """
    if "fingers" in what:
        return detect_fingers(image, intrinsics, _known(json.dumps(what)), hint)
    return detect_cube(image, intrinsics, what, hint)


@lru_cache(maxsize=8)
def _known(document: str) -> dict[str, Finger]:
    return fingers_of(json.loads(document))


def view_of(
    grey: np.ndarray, tags: list[Tag], camera: PinholeCamera, fingers: dict[str, Finger], hints: dict[str, CubePose]
) -> View:
    """Return the fingertips by tags that were read in an image, uint8, shape (height, width)."""
    cubes = {}
    for name, finger in fingers.items():
        pose = solve_cube(grey, tags, finger.cube, camera, hints.get(name))
        if pose is not None:
            cubes[name] = pose
    tips = {name: tip_of(pose, fingers[name]) for name, pose in cubes.items()}
    return View(tips, tuple(tags), mixups(fingers, cubes))


def tip_of(pose: CubePose, finger: Finger) -> TipPose:
    """Return a fingertip's pose from its cube's; the covariance includes the lever arm."""
    from scipy.spatial.transform import Rotation

    matrix = pose.matrix @ finger.tip
    x, y, z = matrix[:3, 3] - pose.position
    lever = np.eye(6)
    # A small rotation w moves the tip by w x arm.
    lever[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    covariance = lever @ pose.covariance @ lever.T if np.isfinite(pose.covariance).all() else pose.covariance
    covariance = covariance + np.diag([0.0] * 3 + [finger.tip_spread**2] * 3)
    return TipPose(matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat(), covariance, pose)
