"""Normals and axes that backends need to draw a scene in three dimensions."""

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.viewers.scene.scene import Body, CameraView, SkinSurface


def cube_axes(camera: CameraView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where a cube's axes begin, where they point, and how many each frame has.

    Returns:
        Origins and vectors [mm, camera frame], shape (3 m, 3) for the m poses with a tag in view, and the
        number of arrows of each pose (3, or 0 without a tag), shape (p,).
    """
    visible = np.isfinite(camera.cube_position).all(axis=1)
    turns = Rotation.from_quat(camera.cube_quaternion[visible]).as_matrix() if visible.any() else np.zeros((0, 3, 3))
    vectors = camera.cube_side * turns.transpose(0, 2, 1).reshape(-1, 3)
    return np.repeat(camera.cube_position[visible], 3, axis=0), vectors, np.where(visible, 3, 0)


def normals(surface: SkinSurface) -> np.ndarray:
    """Return a surface's unit normals at its vertices [1], shape (n, pixels_x * pixels_y, 3), float32."""
    slope_x, slope_y = np.gradient(surface.height, surface.x, surface.y, axis=(1, 2))
    raw = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
    unit = raw / np.linalg.norm(raw, axis=-1, keepdims=True)
    return unit.reshape(len(unit), -1, 3).astype(np.float32)


def body_normals(body: Body) -> np.ndarray:
    """Return the unit normals of a body at its vertices, weighted by area [1], shape (v, 3)."""
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    total = np.zeros_like(body.vertices)
    for corner in range(3):
        np.add.at(total, body.faces[:, corner], area)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
