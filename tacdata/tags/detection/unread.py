"""Explains why no tag is read in images that may show some: a mirror, white on black, or another family."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.tags.detection.detector import detect_tags, to_grey

OTHERS = {
    "25h9": "APRILTAG_25H9",
    "36h10": "APRILTAG_36H10",
    "16h5": "APRILTAG_16H5",
    "ArUco 4x4": "4X4_1000",
    "ArUco 5x5": "5X5_1000",
    "ArUco 6x6": "6X6_1000",
}
"""Families that cubes are printed with by mistake, and OpenCV's names for them."""
SHARE = 0.5
"""Smallest share [1] of the images that must show a tag: small families are read by chance in a single image."""


@dataclass(frozen=True)
class Unread:
    """Tags that are there but not read."""

    found: str
    """Content of the images, as a sentence."""
    remedy: str
    """Remedy."""


def why_unread(images: Sequence[np.ndarray]) -> Unread | None:
    """Return why images show tags that are not read; None if nothing that was tried is seen in half of them.

    Args:
        images: A few images without a tag of family 36h11, grey or BGR, uint8.
    """
    greys = [to_grey(image) for image in images]
    for count, reason in _readings():
        hits = sum(count(grey) > 0 for grey in greys)
        if greys and hits >= max(SHARE * len(greys), min(2, len(greys))):
            return Unread(f"{hits} of {len(greys)} images show {reason.found}", reason.remedy)
    return None


def _readings() -> Iterator[tuple[Callable[[np.ndarray], int], Unread]]:
    """Yield how to count tags in a grey image in another way, and the meaning of a find."""
    yield _mirrored, Unread("mirrored tags", "switch the camera's mirroring off")
    yield _inverted, Unread("tags in white on black", "print the tags black on white")
    for name, dictionary in OTHERS.items():
        reason = Unread(f"tags of the family {name}", "print tags of the family 36h11")
        yield (lambda grey, dictionary=dictionary: _others(grey, dictionary)), reason


def _mirrored(grey: np.ndarray) -> int:
    return len(detect_tags(np.ascontiguousarray(grey[:, ::-1])))


def _inverted(grey: np.ndarray) -> int:
    return len(detect_tags(255 - grey))


def _others(grey: np.ndarray, dictionary: str) -> int:
    import cv2

    markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{dictionary}"))
    _, ids, _ = cv2.aruco.ArucoDetector(markers).detectMarkers(grey)
    return 0 if ids is None else len(ids)
