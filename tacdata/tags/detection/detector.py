"""Detects AprilTags: a cheap search finds candidates, the AprilTag library reads them.

The library locates corners to a quarter of a pixel but takes a hundred milliseconds for a noisy image of 1280 x 720.
With only the small boxes that `search` leaves, it takes one.
"""

from __future__ import annotations

from functools import cache
from threading import Lock
from typing import Any

import numpy as np

from tacdata.errors import UsageError
from tacdata.tags.detection.search import Suspect, suspects
from tacdata.tags.detection.tag import Tag

HALF_PIXEL = 0.5
"""The AprilTag library puts pixel centres at halves (AprilRobotics/apriltag issue 121); OpenCV does not."""
HAMMING, MARGIN = 2, 15.0
"""Largest number of corrected bits, and smallest decision margin, of an accepted tag."""
TINY, SMALL, LARGE = 28, 40, 160
"""Sizes of a candidate [px]: below the first it is read in double size at once, below the second in double size if it
cannot be read as it is, from the third in half size or less.
"""
ROOM = 0.25
"""Margin around a candidate, over its size [1]: a tag needs some white around it."""
NEAR = 1.2
"""Distance from a tag, over its size [1], within which the other tags of its cube lie."""
LAST = 24
"""Boxes that do not look like a tag and are read if nothing else was found."""
_LOCK = Lock()


def detect_tags(image: np.ndarray, *, whole: bool = True, within: tuple[int, int, int, int] | None = None) -> list[Tag]:
    """Return the tags of family 36h11 in an image, in no particular order.

    Args:
        image: Grey (height, width) or BGR (height, width, 3), uint8.
        whole: Pass the whole image to the AprilTag library, not only the candidates.
        within: Left, top, right, bottom [px] of the part to look at.

    Raises:
        UsageError: If the image has another shape or type.
    """
    grey = to_grey(image)
    height, width = grey.shape
    left, top, right, bottom = within or (0, 0, width, height)
    left, top = max(left, 0), max(top, 0)
    part = grey[top : min(bottom, height), left : min(right, width)]
    if not part.size:
        return []
    offset = np.array([left, top], float)
    tags = _read(part, (0, 0, part.shape[1], part.shape[0]), 1.0) if whole else _read_suspects(part)
    return [Tag(tag.id, tag.corners + offset, tag.margin, tag.hamming) for tag in tags]


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
    description = f"{type(image).__name__} {getattr(image, 'dtype', '')} of shape {getattr(image, 'shape', '()')}"
    allowed = "uint8, shape (height, width) or (height, width, 3) BGR"
    return UsageError(f"image: {description}", allowed, "convert the image")


@cache
def _april() -> Any:
    """Return the process's only AprilTag detector: creating and deleting several has crashed the library."""
    import pyapriltags

    return pyapriltags.Detector(families="tag36h11", nthreads=1, quad_decimate=1.0, refine_edges=0)


def _read_suspects(grey: np.ndarray) -> list[Tag]:
    """Read the candidates, then the neighbourhood of each tag read; without one, the smallest remaining boxes."""
    tags: list[Tag] = []
    remainder = []
    for suspect in suspects(grey):
        if suspect.framed:
            _read_one(grey, suspect, tags)
        else:
            remainder.append(suspect)
    read = [(tag.corners, NEAR * tag.size) for tag in tags]
    neighbours = [s for s in remainder if any(s.is_near(corners, reach) for corners, reach in read)]
    for suspect in neighbours if tags else sorted(remainder, key=lambda s: s.size)[:LAST]:
        _read_one(grey, suspect, tags)
    return tags


def _read_one(grey: np.ndarray, suspect: Suspect, tags: list[Tag]) -> None:
    """Add a candidate's tags; two boxes may show the same tag, which counts once."""
    height, width = grey.shape
    scale = 1.0
    while suspect.size * scale >= LARGE:
        scale /= 2
    # The library needs some pixels a cell. Tiny tags are read enlarged first, large ones reduced, as its time grows
    # with pixels.
    scales = (2.0, scale) if suspect.size < TINY else (scale, 2.0) if suspect.size < SMALL else (scale,)
    box = suspect.box(ROOM * suspect.size + 3, width, height)
    readings = next((readings for each in scales if (readings := _read(grey, box, each))), [])
    for tag in readings:
        same = [t for t in tags if t.id == tag.id and np.abs(t.corners - tag.corners).max() < tag.size / 2]
        if all(tag.margin > rival.margin for rival in same):
            tags[:] = [t for t in tags if not any(t is rival for rival in same)] + [tag]


def _read(grey: np.ndarray, box: tuple[int, int, int, int], scale: float) -> list[Tag]:
    """Run the AprilTag library on a box (left, top, right, bottom) [px], scaled by ``scale``."""
    import cv2

    left, top, right, bottom = box
    crop = grey[top:bottom, left:right]
    if scale != 1.0:
        kind = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
        crop = cv2.resize(crop, None, fx=scale, fy=scale, interpolation=kind)
    with _LOCK:
        detections = _april().detect(np.ascontiguousarray(crop))
    # In the library's coordinates a pixel's corner is a whole number, so scaling is plain division, by the ratio of the
    # rounded sides.
    scales = np.array([crop.shape[1] / (right - left), crop.shape[0] / (bottom - top)])
    offset = np.array([left, top], float) - HALF_PIXEL
    return [
        Tag(int(d.tag_id), d.corners / scales + offset, float(d.decision_margin), int(d.hamming))
        for d in detections
        if d.hamming <= HAMMING and d.decision_margin >= MARGIN and np.isfinite(d.corners).all()
    ]
