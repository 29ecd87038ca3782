"""A board's corners in an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tacdata.tags.board import Board
from tacdata.tags.detection.detector import to_grey

LEAST_CORNERS = 8
"""Minimum number of corners in an image."""


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners of a board in one image."""

    name: str
    """Name of the image."""
    ids: np.ndarray
    """Numbers of the corners seen [1], shape (n,)."""
    corners: np.ndarray
    """Positions of the corners [px], shape (n, 2); whole numbers are pixel centres."""

    def moved(self, reference: BoardView) -> float:
        """Return the distance between the corners that both views show [px], median; infinite if they share none."""
        _, rows, reference_rows = np.intersect1d(self.ids, reference.ids, return_indices=True)
        if not len(rows):
            return np.inf
        return float(np.median(np.linalg.norm(self.corners[rows] - reference.corners[reference_rows], axis=1)))


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers of one dictionary in one image."""

    corners: Sequence[np.ndarray]
    """Positions of each marker's corners [px], shape (1, 4, 2) a marker."""
    ids: np.ndarray
    """Numbers of the markers [1], shape (m,)."""


def find_markers(image: np.ndarray, dictionary: str) -> Markers:
    """Return a dictionary's markers in an image; see `find_board`."""
    import cv2

    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}")))
    corners, ids, _ = detector.detectMarkers(to_grey(image))
    return Markers(corners, np.zeros(0, np.int32) if ids is None else np.ravel(ids))


def find_board(image: np.ndarray, board: Board, name: str = "", markers: Markers | None = None) -> BoardView | None:
    """Return a board's corners to a fraction of a pixel, or None if fewer than `LEAST_CORNERS` are seen.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        board: The board.
        name: Name of the view.
        markers: Those of the board's dictionary in the image, if they are known already.

    Raises:
        UsageError: If the image has another shape or type.
    """
    import cv2

    hints: dict[str, Any] = {}
    if markers is not None:
        if not len(markers.ids):
            return None
        hints = {"markerCorners": markers.corners, "markerIds": markers.ids[:, None]}
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board.opencv).detectBoard(to_grey(image), **hints)
    if corners is None or ids is None or len(ids) < LEAST_CORNERS:
        return None
    return BoardView(name, np.asarray(ids).ravel(), np.asarray(corners, float).reshape(-1, 2))
