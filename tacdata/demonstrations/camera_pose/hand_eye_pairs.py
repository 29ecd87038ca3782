"""Reads hand-eye pairs (`schemas/hand_eye_pairs.schema.json`), with cube poses or with images, and solves them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.demonstrations.camera_pose.hand_eye import hand_eye
from tacdata.demonstrations.camera_world import CameraWorld, pose_matrix
from tacdata.errors import FormatError, UsageError


def solve_pairs(path: Path) -> CameraWorld:
    """Return the pose of the camera from a file of pairs.

    Raises:
        UsageError: If the file or an image does not exist, or the pairs do not determine the camera.
        FormatError: If the file is damaged, or the pairs contradict each other.
    """
    document = documents.read(Path(path), "hand_eye_pairs")
    grippers, cubes = [], []
    for number, pair in enumerate(document["pairs"]):
        origin = f"{path}: pairs/{number}"
        cube = _cube(pair, document, Path(path).parent, origin)
        if cube is not None:
            grippers.append(pose_matrix(pair["gripper"], f"{origin}/gripper"))
            cubes.append(cube)
    return hand_eye(document["camera"], document["frame"], np.array(grippers), np.array(cubes))


def _cube(pair: dict[str, Any], document: dict[str, Any], folder: Path, origin: str) -> np.ndarray | None:
    """Return the cube in the camera, shape (4, 4) [m]; None if its image does not show it unambiguously."""
    if "cube" in pair:
        return pose_matrix(pair["cube"], f"{origin}/cube")
    from tacdata.tags import detect_cube
    from tacdata.tags.calibration.image_file import read_grey

    if "intrinsics" not in document or "tag_cube" not in document:
        raise FormatError(f"{origin} names an image", "intrinsics and tag_cube beside pairs", "add them to the file")
    file = folder / pair["image"]
    if not file.is_file():
        raise UsageError(f"{origin}: no image {file}", "an image file", "correct its name")
    pose = detect_cube(read_grey(file), document["intrinsics"], document["tag_cube"])
    # A mirrored pose would pull the fit; one pair less costs little.
    return None if pose is None or pose.ambiguous else pose.matrix
