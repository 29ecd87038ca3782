"""Finds candidates for tags: dark blobs with four corners, at half size.

A tag's black border is one connected blob, darker than its surroundings, whose convex hull has four corners. At half
size the search takes about two milliseconds for 1280 x 720. It leaves a few small boxes for the AprilTag library, whose
cost grows with the area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WINDOW = 21
"""Side [px of the half-size image] of the neighbourhood that a blob must be darker than."""
DARKER = (3.0, 10.0)
"""Smallest and largest threshold of the difference [1 of 255]; between them it is four times the noise."""
LEAST_SIDE = 4
"""Shorter side [px of the half-size image] of the smallest blob: a tag of 8 px has no readable bits."""
SLENDER = 6.0
"""Ratio of a box's sides [1] from which a blob is a line."""
MOST = 400
"""Blobs that are examined, the largest first: an image of noise or grass has thousands."""
FULL = 0.7
"""Minimum share [1] of its convex hull's area that the hull's quadrilateral covers, and the reverse."""
PATTERN = (0.02, 0.95)
"""Brightness of a tag's inside between its frame (0) and the paper around it (1)."""
DARK = 0.3
"""Minimum share [1] of the hull that the blob fills: a tag's border alone fills 0.44."""


@dataclass(frozen=True)
class Suspect:
    """A candidate: a box that may hold a tag."""

    low: tuple[int, int]
    """First column and row of the blob's box [px]."""
    high: tuple[int, int]
    """Last column and row, exclusive [px]."""
    framed: bool = True
    """Whether it looks like a dark frame around a pattern; a tag's neighbour may be one without looking so."""

    @property
    def size(self) -> int:
        """Longer side [px]."""
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1])

    def is_near(self, corners: np.ndarray, reach: float) -> bool:
        """Whether the box comes within ``reach`` [px] of the box of some corners [px], shape (n, 2)."""
        low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
        return bool((np.array(self.high) > low).all() and (np.array(self.low) < high).all())

    def box(self, room: float, width: int, height: int) -> tuple[int, int, int, int]:
        """Return left, top, right, bottom [px] with a margin of ``room`` [px], clipped to the image."""
        extra = int(np.ceil(room))
        return (
            max(self.low[0] - extra, 0),
            max(self.low[1] - extra, 0),
            min(self.high[0] + extra, width),
            min(self.high[1] + extra, height),
        )


def suspects(grey: np.ndarray) -> list[Suspect]:
    """Return the candidates in an image, uint8, shape (height, width)."""
    import cv2

    # At half size there are a quarter of the pixels and half of the noise, and readable tags still show.
    half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    if min(half.shape) < WINDOW:
        return [Suspect((0, 0), (grey.shape[1], grey.shape[0]))]
    # A threshold below the noise would turn grain into thousands of blobs.
    darker = float(np.clip(4 * noise(half), *DARKER))
    kind = cv2.ADAPTIVE_THRESH_MEAN_C
    dark = cv2.adaptiveThreshold(half, 1, kind, cv2.THRESH_BINARY_INV, WINDOW, darker)
    # The default algorithm is two to three times slower on one core.
    _, labels, boxes, _ = cv2.connectedComponentsWithStatsWithAlgorithm(dark, 8, cv2.CV_32S, cv2.CCL_GRANA)
    widths, heights = boxes[:, cv2.CC_STAT_WIDTH], boxes[:, cv2.CC_STAT_HEIGHT]
    short, long = np.minimum(widths, heights), np.maximum(widths, heights)
    likely = (short >= LEAST_SIDE) & (long <= SLENDER * short)
    # A quadrilateral turned by 45 degrees covers half of its box.
    likely &= boxes[:, cv2.CC_STAT_AREA] >= 0.5 * DARK * widths * heights
    likely[0] = False  # bright cells
    places, quads = [], []
    labels_left = np.flatnonzero(likely)
    if len(labels_left) > MOST:
        labels_left = labels_left[np.argsort(-boxes[labels_left, cv2.CC_STAT_AREA])[:MOST]]
    for label in labels_left:
        left, top, width, height, area = (int(value) for value in boxes[label])
        blob = (labels[top : top + height, left : left + width] == label).view(np.uint8)
        quad = _four_corners(blob, area)
        if quad is not None:
            places.append(((2 * left, 2 * top), (2 * (left + width), 2 * (top + height))))
            quads.append(np.add(_grown(quad), (left, top)))
    if not quads:
        return []
    # A pixel of the half-size image covers two by two, whose centre is half a pixel further.
    framed = _framed(grey, 2 * np.array(quads) + 0.5)
    return [Suspect(low, high, bool(good)) for (low, high), good in zip(places, framed, strict=True)]


def noise(grey: np.ndarray) -> float:
    """Return the standard deviation of an image's noise [1 of 255] from a twentieth of its rows.

    Immerkaer, "Fast noise variance estimation", CVIU 64, 1996, along rows: second differences of white noise have
    sqrt(6) times its standard deviation. Their median is robust against edges.
    """
    rows = grey[::20].astype(np.int16)
    # The median size of a normal variable is 0.6745 standard deviations.
    return float(np.median(np.abs(rows[:, 2:] - 2 * rows[:, 1:-1] + rows[:, :-2]))) / 0.6745 / np.sqrt(6)


def _four_corners(blob: np.ndarray, area: int) -> np.ndarray | None:
    """Return the corners [px], shape (4, 2), of a blob (uint8 0 or 1, ``area`` pixels); None without four."""
    import cv2

    outlines, _ = cv2.findContours(blob, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    hull = cv2.convexHull(outlines[0])
    # An outline runs through pixel centres: half a pixel is missing all around.
    length = cv2.arcLength(hull, True)
    covered = cv2.contourArea(hull)
    if area < DARK * (covered + length / 2 + 1):
        return None
    corners = cv2.approxPolyDP(hull, max(1.5, 0.05 * length), True)
    if len(corners) != 4 or cv2.contourArea(corners) < FULL * covered:
        return None
    return corners[:, 0]


def _grown(quad: np.ndarray) -> np.ndarray:
    """Return a quadrilateral [px], shape (4, 2), whose corners lie half a pixel further out on both axes."""
    return quad + 0.5 * np.sign(quad - quad.mean(axis=0))


def _framed(grey: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Return for each quadrilateral [px], shape (n, 4, 2), whether it is a dark frame on paper around a pattern."""
    import cv2

    places = np.einsum("pk,nkd->npd", _WEIGHTS, quads).astype(np.float32)
    patterns = cv2.remap(grey, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    paper, frame, inside = (patterns[:, kind].mean(axis=1) for kind in (_PAPER, _FRAME, _INSIDE))
    contrast = paper - frame
    share = (inside - frame) / np.maximum(contrast, 1e-3)
    return (contrast > DARKER[0]) & (share > PATTERN[0]) & (share < PATTERN[1])


def _grid() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return bilinear weights of the corners, shape (100, 4), at a tag's cells and around it, and the kind of each."""
    cells = (np.arange(-1, 9) + 0.5) / 8
    u, v = (axis.ravel() for axis in np.meshgrid(cells, cells))
    away = np.maximum(np.abs(u - 0.5), np.abs(v - 0.5)) * 8
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
    return weights, away > 4, (away > 3) & (away < 4), away < 3


_WEIGHTS, _PAPER, _FRAME, _INSIDE = _grid()
