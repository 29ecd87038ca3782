"""A ChArUco board's pose in a camera's images."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from tacdata.demonstrations.paths.motion_filter import exponential
from tacdata.errors import UsageError
from tacdata.tags.board import Board
from tacdata.tags.calibration.board_mismatch import mismatch
from tacdata.tags.calibration.board_view import find_board
from tacdata.tags.camera import PinholeCamera

SAMPLE = 4
"""Images without the board that are kept, to find out why."""


def board_poses(
    images: Iterable[tuple[str, np.ndarray]], board: Board, intrinsics: dict[str, Any]
) -> tuple[list[np.ndarray], float, float]:
    """Return the board's pose in the camera for each image of it.

    The board's frame is OpenCV's: origin at an outer corner of the board, x along its columns, y along its rows.

    Args:
        images: Names and images, grey or BGR, uint8.
        board: The board.
        intrinsics: Of the camera [px].

    Returns:
        Poses, shape (4, 4) [m]; reprojection error, root mean square [m at the board]; standard uncertainty of the
        camera's position from one image [m].

    Raises:
        UsageError: If no image shows the board, or an image is of another size.
    """
    import cv2

    camera, corners = (
        PinholeCamera.from_document(intrinsics),
        np.asarray(board.opencv.getChessboardCorners(), float) / 1000,
    )
    poses, squares, spreads, empty = [], [], [], []
    for name, image in images:
        camera.check(image)
        view = find_board(image, board, name)
        if view is None:
            empty = [*empty, image][-SAMPLE:]
            continue
        places = corners[view.ids]
        good, turn, shift = cv2.solvePnP(places, view.corners, camera.matrix, camera.distortion)
        if not good:
            continue
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = exponential(turn.ravel()), shift.ravel()
        deviation = _pixels(places, pose, camera) - view.corners
        poses.append(pose)
        # A pixel in metres at the board's distance.
        metre = float(shift[2, 0]) / camera.matrix[0, 0]
        squares.append(float((deviation**2).sum(axis=1).mean()) * metre**2)
        # Six numbers of the pose were fitted to these deviations.
        variance = float((deviation**2).sum()) / max(2 * len(deviation) - 6, 1)
        spreads.append(_camera_spread(places, pose, camera, variance))
    if not poses:
        why = mismatch(empty, board)
        raise UsageError(
            "no image shows the board" + (f"; instead, {why.found}" if why else ""),
            "images with 8 or more of its corners",
            why.remedy if why else "check the board file and the light",
        )
    return poses, float(np.sqrt(np.mean(squares))), float(np.median(spreads))


def _pixels(places: np.ndarray, pose: np.ndarray, camera: PinholeCamera) -> np.ndarray:
    """Return the pixels, shape (n, 2), of points of the board [m], shape (n, 3)."""
    import cv2

    camera_points = places @ pose[:3, :3].T + pose[:3, 3]
    return cv2.projectPoints(camera_points, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)[0][:, 0]


def _camera_spread(places: np.ndarray, pose: np.ndarray, camera: PinholeCamera, variance: float) -> float:
    """Return the standard uncertainty of the camera's position in the board's frame, -R^T t [m]."""
    start, step, columns = _pixels(places, pose, camera), 1e-6, []
    for k in range(6):
        x, trial = step * np.eye(6)[k], pose.copy()
        trial[:3, :3], trial[:3, 3] = exponential(x[:3]) @ pose[:3, :3], pose[:3, 3] + x[3:]
        columns.append(((_pixels(places, trial, camera) - start) / step).ravel())
    slopes = np.stack(columns, axis=1)
    covariance = variance * np.linalg.pinv(slopes.T @ slopes)
    x, y, z = pose[:3, 3]
    lever = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    jacobian = np.hstack([lever, np.eye(3)])  # a small rotation of the board in the camera, then its translation
    return float(np.sqrt(np.trace(jacobian @ covariance @ jacobian.T)))
