"""Renders a flat printed sheet, for example a calibration board, as a camera sees it."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.virtual_rig.optics.look import Look
from tacdata.virtual_rig.optics.render import BACKGROUND, Lens, expose

FINE = 2
"""Fine pixels per pixel, along each axis."""


def whole_lens(intrinsics: dict[str, Any]) -> Lens:
    """Return the rays of all fine pixels of a camera."""
    return Lens((0, 0, intrinsics["width"], intrinsics["height"]), FINE, intrinsics)


def render_sheet(
    print_of: np.ndarray,
    width: float,
    pose: np.ndarray,
    intrinsics: dict[str, Any],
    rng: np.random.Generator,
    look: Look | None = None,
    lens: Lens | None = None,
) -> np.ndarray:
    """Return a grey image, uint8, shape (height, width).

    Args:
        print_of: The sheet's grey values, uint8, rows downwards; about as many of them as the image has pixels.
        width: Width of the sheet [m].
        pose: The sheet's frame in the camera frame, shape (4, 4) [m]: origin in its upper left corner, x to the
            right, y down the sheet, z into it.
        intrinsics: The camera, as a rig file has it.
        rng: Source of the noise.
        look: Optics, light and obstacles; movement is not rendered.
        lens: The camera's `whole_lens`, for many images; with distortion it takes seconds to compute.
    """
    import cv2

    look = look or Look()
    size = (intrinsics["width"], intrinsics["height"])
    canvas = np.full((size[1] * FINE, size[0] * FINE), BACKGROUND, np.float32)
    texel = width / print_of.shape[1]
    plane = pose[:3, [0, 1, 3]] * (texel, texel, 1.0)
    shift = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1.0]])
    # A texel's centre is half a texel from its corner; whole texel coordinates are centres.
    (lens or whole_lens(intrinsics)).paint(canvas, print_of.astype(np.float32), shift @ np.linalg.inv(plane))
    image = cv2.resize(canvas, size, interpolation=cv2.INTER_AREA)
    return expose(image, [(0, 0, *size)], look, rng)
