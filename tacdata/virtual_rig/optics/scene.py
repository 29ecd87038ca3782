"""Pose of the emulated camera, and of the cube on the carriage as it sees it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

INTRINSICS = {"width": 640, "height": 480, "fx": 900.0, "fy": 900.0, "cx": 319.5, "cy": 239.5}
CUBE = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}
CUBE_HEIGHT = 60.0
"""Height of the cube's centre above the indenter's lowest point [mm]."""
CAMERA_OFFSET = (170.0, -190.0, 140.0)
"""From the cube above the sensor to the camera [mm, machine axes]: three faces are seen."""


@dataclass(frozen=True)
class CubeScene:
    """A fixed camera and a cube that rides on the carriage."""

    machine_camera: np.ndarray
    """Camera pose in the machine frame, shape (4, 4), translation in [m]."""
    carriage_cube: np.ndarray
    """Cube pose on the carriage (machine axes, origin at the indenter's lowest point), shape (4, 4), [m]."""

    def camera_cube(self, position: np.ndarray) -> np.ndarray:
        """Return the cube's pose in the camera frame, shape (4, 4), [m], at a position [mm], shape (3,)."""
        machine_cube = self.carriage_cube.copy()
        machine_cube[:3, 3] += position / 1000
        return np.linalg.inv(self.machine_camera) @ machine_cube

    @property
    def document(self) -> dict[str, Any]:
        """The poses as plain data."""
        return {"pose_machine_camera": self.machine_camera.tolist(), "cube_on_carriage": self.carriage_cube.tolist()}


def draw_scene(seed: int, carriage: tuple[float, float, float]) -> CubeScene:
    """Place the camera, as if by hand, to look at the cube when the carriage is at ``carriage`` [mm]."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng([seed, 6])
    cube = np.add(carriage, (0.0, 0.0, CUBE_HEIGHT))
    eye = cube + CAMERA_OFFSET + rng.normal(0, 4, 3)
    camera = looking_at(eye / 1000, cube / 1000)
    riding = np.eye(4)
    # Glued on by hand: half a degree askew, and a little off.
    riding[:3, :3] = Rotation.from_rotvec(rng.normal(0, 0.5, 3), degrees=True).as_matrix()
    riding[:3, 3] = (np.array([0, 0, CUBE_HEIGHT]) + rng.normal(0, 0.3, 3)) / 1000
    return CubeScene(camera, riding)


def looking_at(eye: ArrayLike, target: ArrayLike) -> np.ndarray:
    """Return the frame of a camera that looks at a point, with the world's z upwards in the image, shape (4, 4).

    Args:
        eye: The camera's position in the world [m], shape (3,).
        target: The point [m], shape (3,), not right above or below the camera.
    """
    forward = np.subtract(target, eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose
