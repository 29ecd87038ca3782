"""One face of a cube, rendered from a pose and compared with the image, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tacdata.tags.cube.cube import AXES, Cube

CELL = 12
"""Texels per cell of the pattern."""
COARSE, FINE = 0.75, 2.0
"""Fewest fine pixels rendered per texel [1]: to come near the pose, and for the pose. Few of them shift edges along the
rows of pixels, all in the same way.
"""
FINEST = 8
"""Most fine pixels rendered per pixel and axis [count]."""
CLEAR = 2.25
"""Distance from the paper's edge, in blurs [1], within which the background may shine in."""
FILLED = 0.5
"""Distance [px] by which the pixels of a filled outline exceed it."""
GRAZING = 0.12
"""Cosine between face normal and view below which a face is ignored."""


@dataclass(eq=False)
class FacePatch:
    """Pixels that show one face only."""

    image: np.ndarray
    """Grey values [1 of 255], shape (n,)."""
    columns: np.ndarray
    """Derivatives of the grey values [1], shape (9, n): by rotation [rad], translation [m] and the blur's variance
    [px^2] for a pattern from 0 (black) to 1 (white); one; the pattern.
    """

    def __post_init__(self) -> None:
        base = self.columns[7:]
        moments, right = base @ base.T, base @ self.image
        # Least squares of black and white in closed form: two unknowns a face.
        slack = moments[0, 0] * moments[1, 1] - moments[0, 1] ** 2
        deviation = right[1] * moments[0, 0] - right[0] * moments[0, 1]
        spread = float(self.image @ self.image) * moments[0, 0] - right[0] ** 2
        self.likeness = float(deviation / np.sqrt(slack * spread)) if slack > 1e-9 and spread > 1e-9 else 0.0
        """Correlation of image and pattern [1]."""
        self.contrast = float(deviation / slack) if slack > 1e-9 else 0.0
        """White minus black [1 of 255]."""
        self.black = float(right[0] - self.contrast * moments[0, 1]) / float(moments[0, 0])
        """Black [1 of 255]."""
        self.rest = self.image - self.black - self.contrast * base[1]
        """Image minus drawing [1 of 255], shape (n,)."""


def draw_face(
    face: str,
    rotation: np.ndarray,
    translation: np.ndarray,
    blur: float,
    cube: Cube,
    matrix: np.ndarray,
    grey: np.ndarray,
    detail: float = FINE,
) -> FacePatch | None:
    """Return a face's pixels, or None if the pose turns it away or too little of it is in the image.

    Args:
        face: Which face.
        rotation: From the cube frame to the camera frame [1], shape (3, 3).
        translation: Cube centre in the camera frame [m], shape (3,).
        blur: Standard deviation of the blur [px].
        cube: The cube.
        matrix: Camera matrix [px], shape (3, 3).
        grey: Image without distortion, uint8, shape (height, width).
        detail: Fine pixels rendered per texel, at least [1].
    """
    import cv2

    axes, half = rotation @ AXES[face], cube.tag / 2000
    centre = translation + axes[:, 2] * cube.side / 2000
    # At a grazing angle a cell is less than a pixel wide, and the drawing depends on its sampling.
    if -axes[:, 2] @ centre < GRAZING * np.sqrt(centre @ centre) or centre[2] <= 1e-3:
        return None
    outline = centre + cube.side / 2000 * _SQUARE @ axes[:, :2].T
    if outline[:, 2].min() <= 1e-3:
        return None
    pixels = outline @ matrix.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    # Two pixels around the face feed the derivatives; pixels outside the image are neither rendered nor compared.
    left, top = np.maximum(np.floor(pixels.min(axis=0)), 0).astype(int) - 2
    right, bottom = np.minimum(np.ceil(pixels.max(axis=0)) + 1, grey.shape[::-1]).astype(int) + 2
    if right - left < 6 or bottom - top < 6:
        return None
    # to_plane takes a pixel of the box to right and up on the face in half tags, homogeneous.
    plane = matrix @ np.array([half * axes[:, 0], half * axes[:, 1], centre]).T
    plane[:2] -= np.array([[left], [top]]) * plane[2]
    to_plane = np.linalg.inv(plane)
    width = 2 * half * matrix[0, 0] / centre[2]
    # The drawing has more pixels than the image where cells are small, or edges between pixels would jump.
    fine = int(np.clip(np.ceil(8 * CELL * detail / width), 1, FINEST))
    model = _drawn(cube.ids[face], to_plane, (int(right - left), int(bottom - top)), blur, fine)
    u, v = np.arange(2.0, right - left - 2), np.arange(2.0, bottom - top - 2)[:, None]
    face_x, face_y, depth = (a * u + (b * v + c) for a, b, c in to_plane.tolist())
    face_x, face_y = face_x / depth, face_y / depth
    # Near the paper's edge the background shines in.
    clear = _inset((pixels - (left + 2, top + 2)).tolist(), CLEAR * blur + FILLED)
    if clear is None:
        return None
    paper = np.zeros(face_x.shape, np.uint8)
    cv2.fillConvexPoly(paper, np.rint(16 * np.array(clear)).astype(np.int32), 1, shift=4)
    inside = np.flatnonzero(paper)
    if len(inside) < 30:
        return None
    image = grey[top + 2 : bottom - 2, left + 2 : right - 2].ravel()[inside].astype(float)
    core = model[2:-2, 2:-2]
    slope_x = (model[2:-2, 3:-1] - model[2:-2, 1:-3]).ravel()[inside] / 2
    slope_y = (model[3:-1, 2:-2] - model[1:-3, 2:-2]).ravel()[inside] / 2
    columns = np.empty((9, len(inside)))
    places = np.stack([face_x.ravel()[inside], face_y.ravel()[inside]])
    arm = half * axes[:, :2] @ places + (centre - translation)[:, None]
    slopes_of(slope_x, slope_y, arm, translation, matrix, columns)
    # The heat equation: the derivative of a Gaussian blur by its variance is half the Laplacian.
    columns[6] = (cv2.Laplacian(model, cv2.CV_32F, ksize=1)[2:-2, 2:-2]).ravel()[inside] / 2
    columns[7] = 1.0
    columns[8] = core.ravel()[inside]
    return FacePatch(image, columns)


def _inset(corners: list[list[float]], depth: float) -> list[tuple[float, float]] | None:
    """Return a convex quadrilateral's corners [px] with all edges moved inwards by ``depth`` [px]; None if none is
    left."""
    edges = []
    area = sum(x * v - u * y for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True))
    for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
        length = float(np.hypot(u - x, v - y)) or 1.0
        a, b = (y - v) / length, (u - x) / length
        if area < 0:
            a, b = -a, -b
        edges.append((a, b, -(a * x + b * y) - depth))  # a x + b y + c: distance inwards
    inner = []
    for (a, b, c), (d, e, f) in zip(edges[-1:] + edges[:-1], edges, strict=True):
        cross = a * e - b * d
        if abs(cross) < 1e-9:
            return None
        inner.append(((b * f - c * e) / cross, (c * d - a * f) / cross))
    # Turned inside out, a corner is on the wrong side of an edge.
    if any(a * x + b * y + c < -1e-6 for a, b, c in edges for x, y in inner):
        return None
    return inner


def slopes_of(
    slope_x: np.ndarray,
    slope_y: np.ndarray,
    arm: np.ndarray,
    translation: np.ndarray,
    matrix: np.ndarray,
    columns: np.ndarray,
) -> None:
    """Write the derivatives of the rendering by rotation about the cube's centre and translation to six columns.

    A point that moves by dx in the image takes its value along: the rendering changes by -slope . dx.
    """
    (a, b, c), (x, y, z) = arm, arm + translation[:, None]
    u, v = slope_x * (-matrix[0, 0] / z), slope_y * (-matrix[1, 1] / z)
    w = -(u * x + v * y) / z
    columns[0], columns[1], columns[2] = b * w - c * v, c * u - a * w, a * v - b * u
    columns[3], columns[4], columns[5] = u, v, w


def _drawn(tag: int, to_plane: np.ndarray, size: tuple[int, int], blur: float, fine: int) -> np.ndarray:
    """Return a tag's pattern as the pixels of a box see it, float32, 0 black to 1 white."""
    import cv2

    texture = _pattern(tag)
    texels = len(texture)
    # Half tags to texels (the pattern is 8 cells and 2 cells of paper on each side), rows downwards.
    to_texel = np.array([[4 * CELL, 0, texels / 2 - 0.5], [0, -4 * CELL, texels / 2 - 0.5], [0, 0, 1]])
    # Whole numbers are pixel centres, so pixels of two sizes share their edges and not their centres.
    offset = 0.5 / fine - 0.5
    to_coarse = np.array([[1 / fine, 0, offset], [0, 1 / fine, offset], [0, 0, 1]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    drawn = cv2.warpPerspective(
        texture,
        to_texel @ to_plane @ to_coarse,
        (size[0] * fine, size[1] * fine),
        flags=flags,
        borderMode=cv2.BORDER_REPLICATE,
    )
    drawn = cv2.GaussianBlur(drawn, (0, 0), blur * fine)
    return cv2.resize(drawn, size, interpolation=cv2.INTER_AREA)


_SQUARE = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])


@cache
def _pattern(tag: int) -> np.ndarray:
    """Return a tag's pattern with two cells of paper around it, float32, 0 black to 1 white."""
    import cv2

    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    cells = np.pad(cv2.aruco.generateImageMarker(family, tag, 8, borderBits=1) / 255, 2, constant_values=1.0)
    return np.kron(cells, np.ones((CELL, CELL))).astype(np.float32)
