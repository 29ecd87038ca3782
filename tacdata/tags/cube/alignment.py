"""Refines a cube's pose on the grey values of its faces (analysis by synthesis).

The tags' patterns are rendered from the current pose, blurred, and compared with the image pixel by pixel. Gauss-Newton
steps adjust the pose, black and white of every face, and the blur (Lucas & Kanade 1981; Baker & Matthews, IJCV 56,
2004, forward-additive form). All edges of a pattern count, not only four corners, so the bias of detected corners in
scale vanishes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tacdata.tags.cube.cube import Cube
from tacdata.tags.cube.face_patch import COARSE, FINE, FacePatch, draw_face, slopes_of

STEPS = 4
"""Most Gauss-Newton steps."""
SETTLED = 0.4
"""Movement in the image [px] below which the iteration ends."""
COVERED = (0.05, 0.15)
"""Difference over the contrast [1] from which a pixel counts as covered. It is three times the residual on the detected
faces, within these bounds.
"""
ENTIRE = 0.85
"""Correlation [1] with its pattern from which an undetected face takes part."""
GRAIN = 0.015
"""Standard deviation of a tag's corner [px] that remains in any image: print, lens, drawing."""
ALIKE = 0.6
"""Correlation [1] with its pattern from which a face is present."""


@dataclass(eq=False)
class Alignment:
    """An aligned pose and how well the image agrees with it."""

    rotation: np.ndarray
    """From the cube frame to the camera frame [1], shape (3, 3)."""
    translation: np.ndarray
    """Cube centre in the camera frame [m], shape (3,)."""
    blur: float = 0.8
    """Standard deviation of the blur [px]."""
    likeness: dict[str, float] = field(default_factory=dict)
    """Face that should be visible -> correlation of the image with its pattern [1]."""
    residual: float = np.inf
    """Difference of image and rendering on the detected faces over the contrast [1]: root mean square, without covered
    pixels.
    """
    covariance: np.ndarray = field(default_factory=lambda: np.full((6, 6), np.inf))
    """Covariance of a small rotation in the camera frame [rad] and the translation [m], in this order, shape (6, 6)."""


@dataclass(eq=False)
class _Step:
    """One Gauss-Newton step."""

    move: np.ndarray
    """Rotation [rad], translation [m], the blur's variance [px^2], shape (7,)."""
    covariance: np.ndarray
    """Of rotation [rad] and translation [m], shape (6, 6)."""
    pixels: float
    """About how far rotation and translation move the cube in the image [px]."""


def align(
    start: Alignment, faces: set[str], cube: Cube, matrix: np.ndarray, grey: np.ndarray, steps: int = STEPS
) -> Alignment:
    """Return the pose at which rendering and image agree best near ``start``.

    Args:
        start: First pose, within about half a cell of the truth.
        faces: Faces whose tags were detected; others take part if they correlate with their pattern.
        cube: The cube.
        matrix: Camera matrix [px], shape (3, 3).
        grey: Image without distortion, uint8, shape (height, width).
        steps: Most Gauss-Newton steps; an invisibly small one is the last.
    """
    pose = start
    for step in range(max(steps, 1)):
        patches = _patches(pose, cube, matrix, grey, COARSE if step == 0 else FINE)
        used = [p for f, p in patches.items() if f in faces or p.likeness > ENTIRE]
        detected = [p for f, p in patches.items() if f in faces]
        # Coarse in the first step, as the corners can be off by a pixel; fine drawings have a narrow basin.
        solution = _step(used, pose, matrix, cube, None if step == 0 else pose.residual) if steps else None
        pose = Alignment(
            pose.rotation,
            pose.translation,
            pose.blur,
            {f: p.likeness for f, p in patches.items()},
            _residual(detected, np.zeros(7)),
            pose.covariance,
        )
        if solution is None:
            return pose if step == 0 else replace(start, likeness=pose.likeness)
        pose = Alignment(
            _rotation(solution.move[:3]) @ pose.rotation,
            pose.translation + solution.move[3:6],
            # Blur adds in variances. Below 0.2 px the drawing's own grid is coarser; above 3 px no tag is readable.
            float(np.sqrt(np.clip(pose.blur**2 + solution.move[6], 0.2**2, 3.0**2))),
            pose.likeness,
            _residual(detected, solution.move),
            solution.covariance,
        )
        # The first step is coarse: its smallness proves nothing.
        if step > 0 and solution.pixels < SETTLED:
            break
    return replace(pose, covariance=pose.covariance + _grain(pose, faces, cube, matrix))


def _grain(pose: Alignment, faces: set[str], cube: Cube, matrix: np.ndarray) -> np.ndarray:
    """Return the covariance of rotation [rad] and translation [m] by `GRAIN`, shape (6, 6)."""
    arms = np.concatenate([cube.corners(face) for face in faces]) @ pose.rotation.T
    slopes = np.empty((2, 6, len(arms)))
    for row, (x, y) in zip(slopes, ((-1.0, 0.0), (0.0, -1.0)), strict=True):
        ones = np.ones(len(arms))
        # Unit slopes along x and y: columns are the motion of the corners in pixels.
        slopes_of(x * ones, y * ones, arms.T, pose.translation, matrix, row)
    rows = slopes.transpose(0, 2, 1).reshape(-1, 6)
    return GRAIN**2 * np.linalg.pinv(rows.T @ rows, rcond=1e-12)


def _residual(patches: list[FacePatch], move: np.ndarray) -> float:
    """Return the residual after a step, to first order, over each face's contrast; covered pixels get little weight."""
    if not patches:
        return np.inf
    residuals = [p.rest / max(p.contrast, 1.0) - move @ p.columns[:7] for p in patches]
    return float(COVERED[1] * np.sqrt(np.log1p(np.square(np.concatenate(residuals) / COVERED[1])).mean()))


def _step(
    patches: list[FacePatch], pose: Alignment, matrix: np.ndarray, cube: Cube, scatter: float | None
) -> _Step | None:
    """Return the Gauss-Newton step on some faces; None if they do not determine one.

    Args:
        patches: The faces.
        pose: The pose of the rendering.
        matrix: Camera matrix [px].
        cube: The cube.
        scatter: Residual of the step before, over the contrast [1]. None at the first step: large differences then come
            from the pose.
    """
    normal, right = np.zeros((7, 7)), np.zeros(7)
    squares = count = 0.0
    for patch in patches:
        if patch.contrast <= 1.0:
            continue
        weighted, residual = patch.columns, patch.rest
        # In the first step the residual is not known, and no pixel can be suspected.
        if scatter is not None:
            # Cauchy weights: pixels that cover a part of the face count little.
            weight = 1 / (1 + np.square(residual / (patch.contrast * np.clip(3 * scatter, *COVERED))))
            weighted, residual = weighted * weight, weight * residual
            count += float(weight.sum())
        else:
            count += len(residual)
        squares += float(residual @ patch.rest)
        product, towards = weighted @ patch.columns.T, patch.columns @ residual
        # Black and white of a face are parameters of their own: they are solved for and eliminated.
        inner = product[:7, 7:] @ np.linalg.inv(product[7:, 7:])
        normal += patch.contrast**2 * (product[:7, :7] - inner @ product[7:, :7])
        right += patch.contrast * (towards[:7] - inner @ towards[7:])
    if not count:
        return None
    # Radians, metres and square pixels differ by many orders: scaled to a unit diagonal the matrix is well conditioned.
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    scales = np.outer(scale, scale)
    try:
        inverse = np.linalg.inv(normal / scales + 1e-9 * np.eye(7)) / scales
    except np.linalg.LinAlgError:
        return None
    move = inverse @ right
    # Beyond half a radian the linearization is no guide.
    if not np.isfinite(move).all() or np.linalg.norm(move[:3]) > 0.5:
        return None
    focal, depth = matrix[0, 0], max(float(pose.translation[2]), 1e-3)
    rotation, shift = np.linalg.norm(move[:3]) * cube.side / 1000, np.linalg.norm(move[3:6])
    return _Step(move, squares / count * inverse[:6, :6], float(rotation + shift) * focal / depth)


def _patches(pose: Alignment, cube: Cube, matrix: np.ndarray, grey: np.ndarray, detail: float) -> dict[str, FacePatch]:
    """Draw every face that the pose turns to the camera and that is inside the image."""
    drawn = (
        (face, draw_face(face, pose.rotation, pose.translation, pose.blur, cube, matrix, grey, detail))
        for face in cube.ids
    )
    return {face: patch for face, patch in drawn if patch is not None}


def _rotation(vector: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.Rodrigues(vector)[0]
