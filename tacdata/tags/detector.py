"""Find AprilTags: OpenCV's ArUco detector says where, the AprilTag library says what and exactly where.

ArUco looks through a 1280 x 720 image in a few milliseconds but places corners to a pixel or two; the
AprilTag library places them to a quarter of a pixel but takes a hundred milliseconds for the whole image.
"""

from __future__ import annotations

from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from tacdata.errors import UsageError
from tacdata.tags.tag import Tag

HALF_PIXEL = 0.5
"""The AprilTag library puts pixel centres at halves (AprilRobotics/apriltag issue 121), OpenCV does not."""
HAMMING, MARGIN = 2, 15.0
"""Bits that may be corrected, and the least decision margin, of a tag that is believed."""
SMALL = 160
"""Longer side of a region [px] below which it is looked at in double size: its tags are below 35 px."""
CLUTTER = 0.3
"""Share of the image [1] from which searching it whole is no slower."""
_LOCK = Lock()


def detect_tags(image: np.ndarray, *, whole: bool = True) -> list[Tag]:
    """Return the tags of family 36h11 in an image, in no particular order.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        whole: Search everywhere. Otherwise only around the quadrilaterals that ArUco finds, if there are any.

    Raises:
        UsageError: If this is no such image.
    """
    grey = to_grey(image)
    boxes = [(0, 0, grey.shape[1], grey.shape[0])] if whole else _regions(grey)
    return [tag for box in boxes for tag in _detect(grey, box, enlarge=not whole)]


def to_grey(image: np.ndarray) -> np.ndarray:
    """Return an image as grey uint8, shape (height, width), contiguous.

    Raises:
        UsageError: If it is neither grey nor BGR uint8.
    """
    is_bytes = isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.size > 0
    if not is_bytes or image.ndim not in (2, 3):
        raise _refused(image)
    if image.ndim == 2:
        return np.ascontiguousarray(image)
    if image.shape[2] == 1:
        return np.ascontiguousarray(image[:, :, 0])
    if image.shape[2] != 3:
        raise _refused(image)
    import cv2

    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def _refused(image: Any) -> UsageError:
    given = f"{type(image).__name__} {getattr(image, 'dtype', '')} of shape {getattr(image, 'shape', '()')}"
    allowed = "uint8, shape (height, width) or (height, width, 3) BGR"
    return UsageError(f"image: {given}", allowed, "convert the image")


@cache
def _april() -> Any:
    """Return the process's one AprilTag detector: making and dropping several has crashed the library."""
    import pyapriltags

    return pyapriltags.Detector(families="tag36h11", nthreads=1, quad_decimate=1.0, refine_edges=0)


@cache
def _aruco() -> Any:
    import cv2

    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))


def _detect(grey: np.ndarray, box: tuple[int, int, int, int], *, enlarge: bool) -> list[Tag]:
    """Run the AprilTag library on a box (left, top, right, bottom); a small one is enlarged first on wish."""
    import cv2

    left, top, right, bottom = box
    crop = grey[top:bottom, left:right]
    scale = 2 if enlarge and max(crop.shape) < SMALL else 1
    if scale > 1:
        crop = cv2.resize(crop, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    with _LOCK:
        found = _april().detect(np.ascontiguousarray(crop))
    # In the library's coordinates a pixel's corner is a whole number, so scaling is plain division.
    offset = np.array([left, top], float) - HALF_PIXEL
    return [
        Tag(int(d.tag_id), d.corners / scale + offset, float(d.decision_margin), int(d.hamming))
        for d in found
        if d.hamming <= HAMMING and d.decision_margin >= MARGIN and np.isfinite(d.corners).all()
    ]


def _regions(grey: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Return disjoint boxes (left, top, right, bottom) [px] around quadrilaterals, with room for a cube."""
    with _LOCK:
        read, _, unread = _aruco().detectMarkers(grey)
    height, width = grey.shape
    # ArUco fails to read most tags below 20 px: what it saw but could not read is looked at too, unless it is
    # half of a cluttered image.
    for quads in ([*read, *unread], read):
        boxes = _merge([_roomy(quad[0], width, height) for quad in quads])
        area = sum((b[2] - b[0]) * (b[3] - b[1]) for b in boxes)
        if boxes and area < CLUTTER * grey.size:
            return [(int(b[0]), int(b[1]), int(b[2]), int(b[3])) for b in boxes]
    return [(0, 0, width, height)]


def _roomy(quad: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the box around a quadrilateral, wide enough for the cube that it may belong to, in the image."""
    low, high = quad.min(axis=0), quad.max(axis=0)
    # A neighbour face of the same cube reaches about one tag beside the tag that was found.
    room = 1.2 * float((high - low).max()) + 6
    box = np.concatenate([low - room, high + room])
    return np.clip(np.round(box), 0, [width, height, width, height]).astype(int)


def _merge(boxes: list[np.ndarray]) -> list[np.ndarray]:
    """Join overlapping boxes until none overlap, so that no tag is found twice."""
    merged: list[np.ndarray] = []
    for box in boxes:
        joined = box
        while True:
            hits = [m for m in merged if (m[:2] < joined[2:]).all() and (joined[:2] < m[2:]).all()]
            if not hits:
                break
            merged = [m for m in merged if not any(m is h for h in hits)]
            stack = np.stack([joined, *hits])
            joined = np.concatenate([stack[:, :2].min(axis=0), stack[:, 2:].max(axis=0)])
        merged.append(joined)
    return merged
