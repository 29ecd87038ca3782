"""A camera's intrinsics, with OpenCV's projections."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from tacdata.errors import FormatError, UsageError

WIDEST, LONGEST = 0.1, 50.0
"""Shortest and longest plausible focal length, over the image's width [1]: 157 and 1 degrees of view."""


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """A pinhole camera with OpenCV's distortion. Frame: x right, y down, z forward; whole pixels at pixel centres.

    Example:
        >>> import numpy as np
        >>> from tacdata.tags.camera import PinholeCamera
        >>> intrinsics = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0}
        >>> camera = PinholeCamera.from_document(intrinsics, "my camera")
        >>> camera.project(np.array([[0.01, 0.0, 0.2]])).round(1)  # pixels of a point 0.2 m away
        array([[350., 240.]])
    """

    width: int
    """Image width [px]."""
    height: int
    """Image height [px]."""
    matrix: np.ndarray
    """Camera matrix [px], shape (3, 3)."""
    distortion: np.ndarray
    """k1 k2 p1 p2 [k3 ...], shape (n,)."""

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str = "intrinsics") -> PinholeCamera:
        """Build a camera from a rig file's ``intrinsics`` entry.

        Raises:
            FormatError: If a number is missing or impossible.
        """
        fields = ("width", "height", "fx", "fy", "cx", "cy")
        missing = [name for name in fields if name not in document]
        if missing:
            raise FormatError(f"{origin}: no {', '.join(missing)}", ", ".join(fields), "calibrate the camera")
        width, height, fx, fy, cx, cy = (document[name] for name in fields)
        if min(width, height, fx, fy) <= 0 or not np.isfinite([fx, fy, cx, cy]).all():
            raise FormatError(
                f"{origin}: {width} x {height} px, fx {fx}, fy {fy}, cx {cx}, cy {cy} px",
                "positive and finite",
                "calibrate the camera",
            )
        if not WIDEST * width <= min(fx, fy) or not max(fx, fy) <= LONGEST * width:
            raise FormatError(
                f"{origin}: fx {fx}, fy {fy} px for an image {width} px wide: are these millimetres?",
                f"{WIDEST * width:g} to {LONGEST * width:g} px",
                "calibrate the camera",
            )
        distortion = np.array(document.get("distortion", ()), float)
        # The lengths that OpenCV knows; of another one it would take some coefficients for others.
        if len(distortion) not in (0, 4, 5, 8, 12, 14):
            fault = f"{origin}: {len(distortion)} distortion coefficients"
            raise FormatError(fault, "4, 5, 8, 12 or 14", "calibrate the camera")
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], float)
        return cls(int(width), int(height), matrix, distortion)

    def check(self, image: np.ndarray) -> None:
        """Refuse an image of another size.

        Raises:
            UsageError: Naming both sizes.
        """
        height, width = image.shape[:2]
        if (width, height) != (self.width, self.height):
            raise UsageError(
                f"an image of {width} x {height} px",
                f"{self.width} x {self.height} px, for which the camera was calibrated",
                "set the camera to that size or calibrate it for this one",
            )

    def straighten(self, pixels: np.ndarray) -> np.ndarray:
        """Return pixels, shape (n, 2), with the distortion removed, shape (n, 2)."""
        import cv2

        if not self.distortion.any():
            return pixels
        square = self.matrix
        return cv2.undistortPoints(pixels.reshape(-1, 1, 2), square, self.distortion, P=square)[:, 0]

    def bend(self, pixels: np.ndarray) -> np.ndarray:
        """Return undistorted pixels, shape (n, 2), at their place in the image as taken, shape (n, 2)."""
        import cv2

        if not self.distortion.any():
            return pixels
        rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(self.matrix).T
        return cv2.projectPoints(rays, np.zeros(3), np.zeros(3), self.matrix, self.distortion)[0][:, 0]

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return undistorted pixels, shape (n, 2), of points in the camera frame [m], shape (n, 3)."""
        pixels = points @ self.matrix.T
        return pixels[:, :2] / pixels[:, 2:]

    def window(self, grey: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a part of an image without distortion, and its camera matrix.

        Args:
            grey: The image as taken, shape (height, width).
            low: First column and row [px] of the part, in the straightened image; clipped to it.
            high: Last column and row, exclusive.
        """
        import cv2

        left, top = np.clip(np.floor(low), 0, [self.width - 1, self.height - 1]).astype(int)
        right, bottom = np.clip(np.ceil(high), [left + 1, top + 1], [self.width, self.height]).astype(int)
        # A window moves the optical centre, and nothing else.
        matrix = self.matrix - np.array([[0, 0, left], [0, 0, top], [0, 0, 0]])
        if not self.distortion.any():
            return grey[top:bottom, left:right], matrix
        maps = _straight_maps(self.width, self.height, tuple(self.matrix.ravel()), tuple(self.distortion))
        columns, rows = (m[top:bottom, left:right] for m in maps)
        # OpenCV's cubic kernel shifts by up to 0.05 px between pixels, the linear one by a hundredth at most.
        return cv2.remap(grey, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), matrix


@lru_cache(maxsize=8)
def _straight_maps(
    width: int, height: int, matrix: tuple[float, ...], distortion: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return, for every pixel of the undistorted image, its place in the image as taken."""
    import cv2

    square = np.array(matrix).reshape(3, 3)
    columns, rows = cv2.initUndistortRectifyMap(
        square, np.array(distortion), np.eye(3), square, (width, height), cv2.CV_32FC1
    )
    return columns, rows
