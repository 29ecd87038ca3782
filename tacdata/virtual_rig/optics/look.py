"""How an emulated camera looks at a scene: optics, light, what is in the way, and what the file format costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Polygon = tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Look:
    """One exposure. The default is a sharp lens on a lit bench."""

    blur: float = 0.7
    """Standard deviation of the optical blur [px]."""
    noise: float = 2.0
    """Standard deviation of the sensor's noise [1 of 255]."""
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """How far the cubes move during the exposure [m, camera frame]; the pose asked for is that of its middle."""
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """How far they turn about their centres during the exposure: rotation vector [rad, camera frame]."""
    gain: float = 1.0
    """Brightness of everything [1]; grey values end at 255."""
    fall: float = 0.0
    """Share [1] of the light that is missing at the image's right edge; it falls off evenly from the left."""
    shadow: Polygon = ()
    """Outline [px] of a sharp shadow in which 45 % of the light remains."""
    covers: tuple[Polygon, ...] = ()
    """Outlines [px] of things before the cubes."""
    cover: float = 105.0
    """Their grey value [1 of 255]."""
    background: np.ndarray | None = None
    """What lies behind the cubes, uint8 or float32, shape (height, width); None: an empty bench."""
    jpeg: int | None = None
    """Quality of a JPEG file that the image goes through [1 of 100]; None: none."""
