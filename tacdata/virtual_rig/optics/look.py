"""Image quality of an emulated camera: optics, light, occlusion and compression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Polygon = tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Look:
    """Conditions of one exposure. The default is a sharp lens on a lit bench."""

    blur: float = 0.7
    """Standard deviation of the optical blur [px]."""
    noise: float = 2.0
    """Standard deviation of the sensor's noise [1 of 255]."""
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Movement of the cubes during the exposure [m, camera frame]; the given pose is that of its middle."""
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation of the cubes about their centres during the exposure: rotation vector [rad, camera frame]."""
    gain: float = 1.0
    """Brightness factor [1]; grey values saturate at 255."""
    fall: float = 0.0
    """Share [1] of the light that is missing at the image's right edge; it decreases evenly from the left."""
    shadow: Polygon = ()
    """Outline [px] of a sharp shadow in which 45 % of the light remains."""
    covers: tuple[Polygon, ...] = ()
    """Outlines [px] of things in front of the cubes."""
    cover: float = 105.0
    """Their grey value [1 of 255]."""
    background: np.ndarray | None = None
    """Image behind the cubes, uint8 or float32, shape (height, width); None for an empty bench."""
    jpeg: int | None = None
    """JPEG quality [1 of 100]; None for no compression."""
    rays: int = 4
    """Most rays per pixel and axis [count]. Four shift edges along the rows of pixels by up to a tenth of a pixel."""
