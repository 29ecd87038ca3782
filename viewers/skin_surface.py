"""The skin's outer face as it deforms, and the indenter that presses it."""

from __future__ import annotations

import numpy as np

from tacdata.plans import Press
from tacdata.sensor import Sensor
from viewers.color_scale import scale_of
from viewers.maps import DEPTH_FLOOR
from viewers.scene import Body, DepthMaps, Surface


def surfaces(
    sensor: Sensor, start_ns: int, maps: tuple[DepthMaps, ...], signed: np.ndarray | None
) -> tuple[Surface, ...]:
    """Return the face at z = thickness - depth for the label and the prediction; without either, undeformed.

    Args:
        sensor: Gives the thickness and the pixel grid.
        start_ns: Time of the undeformed face [ns].
        maps: Depth maps; "label" and "prediction" are drawn.
        signed: The label's map with bulging [mm], shape (n, pixels_x, pixels_y), or None for depth alone.
    """
    top = np.float32(sensor.skin.thickness)
    result = []
    for shown in (m for m in maps if m.name in ("label", "prediction")):
        drop = signed if shown.name == "label" and signed is not None else shown.values
        height = (top - drop).astype(np.float32)
        depth = shown.values.astype(np.float32)
        result.append(Surface(shown.name, shown.x, shown.y, shown.time_ns, height, depth, shown.scale))
    if not result:
        flat = np.full((1, *sensor.map.shape), top, dtype=np.float32)
        scale = scale_of(np.zeros(1), "mm", floor=DEPTH_FLOOR)
        result.append(
            Surface(
                "undeformed",
                sensor.map.x,
                sensor.map.y,
                np.array([start_ns]),
                flat,
                np.zeros_like(flat),
                scale,
            )
        )
    return tuple(result)


def footprint(sensor: Sensor) -> np.ndarray:
    """Return the corners of the skin's block with its protrusions [mm], shape (2, 3)."""
    half = np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2
    return np.array([[*-half, -sensor.skin.protrusion_tip], [*half, sensor.skin.thickness]])


def indenter_body(sensor: Sensor, press: Press, time_ns: np.ndarray, tip: np.ndarray) -> Body:
    """Return the indenter at its nominal pose.

    Args:
        sensor: Gives the height of the undeformed face.
        press: Gives the shape and its yaw.
        time_ns: Times [ns], shape (n,).
        tip: x, y and depth of the lowest point [mm], shape (n, 3).
    """
    mesh = press.indenter.surface()
    position = np.column_stack([tip[:, :2], sensor.skin.thickness - tip[:, 2]])
    half = np.radians(press.yaw) / 2
    return Body(
        "indenter",
        np.asarray(mesh.vertices),
        np.asarray(mesh.faces),
        (0.0, 0.0, float(np.sin(half)), float(np.cos(half))),
        time_ns,
        position,
    )
