"""Refine a cube's pose on the grey values of its faces (analysis by synthesis).

The tags' patterns are drawn as the camera would see them from the pose at hand, blurred, and compared with
the image pixel by pixel; a few Gauss-Newton steps on the pose, on black and white of every face and on the
blur make them agree (Lucas & Kanade 1981; Baker & Matthews, IJCV 56, 2004, forward-additive form). All edges
of a pattern count, not only four corners, so that the scale's bias of detected corners falls out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from tacdata.tags.cube import AXES, Cube

STEPS = 3
"""Gauss-Newton steps; a fourth changed the median error of rendered cubes by less than a micrometre."""
FINE = 3
"""Fine pixels a pixel, along each axis, of the drawing."""
CELL = 12
"""Texels a cell of the pattern."""
CLEAR = 2.0
"""Distance from the paper's edge, in blurs [1], up to which something else may shine in."""
GRAZING = 0.12
"""Cosine between face normal and view below which a face is not looked at."""
ALIKE = 0.6
"""Correlation [1] with its pattern from which a face that was not detected takes part."""


@dataclass(eq=False)
class Alignment:
    """A pose and how well the image agrees with it."""

    rotation: np.ndarray
    """From the cube frame to the camera frame [1], shape (3, 3)."""
    translation: np.ndarray
    """Cube centre in the camera frame [m], shape (3,)."""
    blur: float = 0.8
    """Standard deviation of the blur [px]."""
    likeness: dict[str, float] = field(default_factory=dict)
    """Face that should be seen -> correlation of the image with its pattern [1]."""
    residual: float = np.inf
    """Root mean square difference of image and drawing over the contrast of black and white [1]."""


@dataclass(eq=False)
class _Patch:
    """One face's pixels."""

    image: np.ndarray
    """Grey values, shape (n,)."""
    model: np.ndarray
    """Pattern drawn and blurred, 0 black to 1 white, shape (n,)."""
    slopes: np.ndarray
    """Change of `model` with rotation [rad], translation [m] and the blur's variance [px^2], shape (n, 7)."""

    @property
    def likeness(self) -> float:
        a, b = self.image - self.image.mean(), self.model - self.model.mean()
        scale = float(np.sqrt((a @ a) * (b @ b)))
        return float(a @ b) / scale if scale > 0 else 0.0


def align(
    start: Alignment, seen: set[str], cube: Cube, matrix: np.ndarray, grey: np.ndarray, steps: int = STEPS
) -> Alignment:
    """Return the pose at which drawing and image agree best near ``start``.

    Args:
        start: First pose, within about half a cell of the truth.
        seen: Faces whose tags were detected; others take part if they look as they should.
        cube: The cube.
        matrix: Camera matrix [px], shape (3, 3).
        grey: Image without distortion, uint8, shape (height, width).
        steps: Gauss-Newton steps.
    """
    pose = start
    for step in range(steps):
        patches = _patches(pose, cube, matrix, grey)
        used = [p for face, p in patches.items() if face in seen or p.likeness > ALIKE]
        move = _step(used, robust=step >= 2) if used else None
        if move is None:
            pose = start
            break
        pose = Alignment(
            _rotation(move[:3]) @ pose.rotation, pose.translation + move[3:6],
            float(np.sqrt(np.clip(pose.blur**2 + move[6], 0.2**2, 3.0**2))),
        )
    patches = _patches(pose, cube, matrix, grey)
    pose.likeness = {face: patch.likeness for face, patch in patches.items()}
    used = [p for face, p in patches.items() if face in seen or p.likeness > ALIKE]
    pose.residual = _residual(used) if used else np.inf
    return pose


def _step(patches: list[_Patch], robust: bool) -> np.ndarray | None:
    """Return the step in rotation [rad], translation [m] and the blur's variance [px^2], shape (7,)."""
    count = 7 + 2 * len(patches)
    normal, right = np.zeros((count, count)), np.zeros(count)
    for index, patch in enumerate(patches):
        base = np.column_stack([np.ones_like(patch.model), patch.model])
        (black, contrast), *_ = np.linalg.lstsq(base, patch.image, rcond=None)
        if contrast <= 1.0:
            continue
        rest = patch.image - black - contrast * patch.model
        columns = np.zeros((len(rest), count))
        columns[:, :7] = contrast * patch.slopes
        columns[:, 7 + 2 * index : 9 + 2 * index] = base
        # Cauchy weights: what covers a part of the face counts little.
        weight = 1 / (1 + (rest / (0.15 * contrast)) ** 2) if robust else np.ones_like(rest)
        normal += columns.T @ (weight[:, None] * columns)
        right += columns.T @ (weight * rest)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    try:
        damped = normal / np.outer(scale, scale) + 1e-9 * np.eye(count)
        solution = np.linalg.solve(damped, right / scale) / scale
    except np.linalg.LinAlgError:
        return None
    return solution[:7] if np.isfinite(solution).all() and np.linalg.norm(solution[:3]) < 0.5 else None


def _residual(patches: list[_Patch]) -> float:
    """Return the root mean square of what is left, over each face's contrast."""
    rest = []
    for patch in patches:
        base = np.column_stack([np.ones_like(patch.model), patch.model])
        fit, *_ = np.linalg.lstsq(base, patch.image, rcond=None)
        rest.append((patch.image - base @ fit) / max(float(fit[1]), 1.0))
    return float(np.sqrt((np.concatenate(rest) ** 2).mean()))


def _patches(pose: Alignment, cube: Cube, matrix: np.ndarray, grey: np.ndarray) -> dict[str, _Patch]:
    """Draw every face that the pose turns to the camera and that lies inside the image."""
    patches = {}
    for face, tag in cube.ids.items():
        patch = _patch(pose, face, tag, cube, matrix, grey)
        if patch is not None:
            patches[face] = patch
    return patches


def _patch(
    pose: Alignment, face: str, tag: int, cube: Cube, matrix: np.ndarray, grey: np.ndarray
) -> _Patch | None:
    import cv2

    axes, half = pose.rotation @ AXES[face], cube.tag / 2000
    centre = pose.translation + axes[:, 2] * cube.side / 2000
    if -axes[:, 2] @ centre < GRAZING * np.linalg.norm(centre):
        return None
    # Pixels within two and a half blurs of the paper's edge may show what is behind it.
    facing = -axes[:, 2] @ centre / np.linalg.norm(centre)
    half_pixels = half * matrix[0, 0] / centre[2] * facing
    reach = max(1.0, cube.side / cube.tag - CLEAR * pose.blur / half_pixels)
    outline = centre + half * reach * np.array([[a, b] for a in (-1, 1) for b in (-1, 1)]) @ axes[:, :2].T
    if outline[:, 2].min() <= 1e-3:
        return None
    pixels = outline @ matrix.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    left, top = np.floor(pixels.min(axis=0)).astype(int) - 2
    right, bottom = np.ceil(pixels.max(axis=0)).astype(int) + 3
    if (right - left) * (bottom - top) > 4 * grey.size:
        return None
    # to_plane takes a pixel of the box to right and up on the face in half tags, homogeneous.
    plane = np.column_stack([half * axes[:, 0], half * axes[:, 1], centre])
    to_plane = np.linalg.inv(matrix @ plane) @ np.array([[1, 0, left], [0, 1, top], [0, 0, 1.0]])
    model = _drawn(tag, to_plane, (right - left, bottom - top), pose.blur)
    v, u = np.mgrid[: bottom - top, : right - left].reshape(2, -1).astype(float)
    places = to_plane @ np.stack([u, v, np.ones_like(u)])
    places = places[:2] / places[2]
    in_image = (u + left >= 0) & (v + top >= 0) & (u + left < grey.shape[1]) & (v + top < grey.shape[0])
    inside = (np.abs(places) <= reach).all(axis=0) & in_image
    if inside.sum() < 30:
        return None
    slope = np.stack([cv2.Sobel(model, cv2.CV_32F, *axis, ksize=1) for axis in ((1, 0), (0, 1))]) / 2
    curvature = cv2.Laplacian(model, cv2.CV_32F, ksize=1)
    arm = half * places[:, inside].T @ axes[:, :2].T + (centre - pose.translation)
    image = grey[v[inside].astype(int) + top, u[inside].astype(int) + left].astype(float)
    slopes = _slopes(slope.reshape(2, -1)[:, inside], arm, pose.translation, matrix)
    return _Patch(
        image, model.ravel()[inside].astype(float), np.column_stack([slopes, curvature.ravel()[inside] / 2])
    )


def _slopes(slope: np.ndarray, arm: np.ndarray, translation: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return the change of the drawing with rotation about the cube's centre and translation, shape (n, 6).

    A point that moves by dx in the image takes its value along: the drawing changes by -slope . dx.
    """
    (x, y, z), (a, b, c) = (arm + translation).T, arm.T
    u, v = -slope[0] * matrix[0, 0] / z, -slope[1] * matrix[1, 1] / z
    w = -(u * x + v * y) / z
    return np.stack([b * w - c * v, c * u - a * w, a * v - b * u, u, v, w], axis=-1)


def _drawn(tag: int, to_plane: np.ndarray, size: tuple[int, int], blur: float) -> np.ndarray:
    """Return a tag's pattern as the pixels of a box see it, float32, 0 black to 1 white."""
    import cv2

    fine = FINE
    texture = _pattern(tag)
    texels = len(texture)
    # Half tags to texels (the pattern is 8 cells and 2 cells of paper on each side), rows downwards.
    to_texel = np.array([[4 * CELL, 0, texels / 2 - 0.5], [0, -4 * CELL, texels / 2 - 0.5], [0, 0, 1]])
    offset = 0.5 / fine - 0.5
    to_coarse = np.array([[1 / fine, 0, offset], [0, 1 / fine, offset], [0, 0, 1]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    drawn = cv2.warpPerspective(
        texture, to_texel @ to_plane @ to_coarse, (size[0] * fine, size[1] * fine),
        flags=flags, borderMode=cv2.BORDER_REPLICATE,
    )
    drawn = cv2.GaussianBlur(drawn, (0, 0), blur * fine)
    return cv2.resize(drawn, size, interpolation=cv2.INTER_AREA)


@cache
def _pattern(tag: int) -> np.ndarray:
    """Return a tag's pattern with two cells of paper around it, float32, 0 black to 1 white."""
    import cv2

    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    cells = np.pad(cv2.aruco.generateImageMarker(family, tag, 8, borderBits=1) / 255, 2, constant_values=1.0)
    return np.kron(cells, np.ones((CELL, CELL))).astype(np.float32)


def _rotation(vector: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.Rodrigues(vector)[0]
