"""The skin's outer face as it deforms, and the indenter that presses it."""

import numpy as np
from scipy.spatial.transform import Rotation

from tacdata.plans import Press
from tacdata.sensor import Sensor
from tacdata.viewers.parts.maps import DEPTH_FLOOR
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.color_scale import scale_of
from tacdata.viewers.scene.scene import Body, Cloud, DepthMaps, SkinSurface


def surfaces(
    sensor: Sensor, start_ns: int, maps: tuple[DepthMaps, ...], signed: tuple[np.ndarray, np.ndarray] | None
) -> tuple[SkinSurface, ...]:
    """Return the face at z = thickness - depth for the label and the prediction; without either, undeformed.

    Args:
        sensor: Gives the thickness and the pixel grid.
        start_ns: Time of the undeformed face [ns].
        maps: Depth maps; "label" and "prediction" are drawn.
        signed: The label's times [ns], shape (n,), ascending, and maps with bulging [mm], shape (n, pixels_x,
            pixels_y); or None for depth alone.
    """
    top = np.float32(sensor.skin.thickness)
    result = []
    for layer in (m for m in maps if m.name in ("label", "prediction")):
        drop = layer.values
        if layer.name == "label" and signed is not None:
            drop = signed[1][np.searchsorted(signed[0], layer.time_ns)]
        height = (top - drop).astype(np.float32)
        depth = layer.values.astype(np.float32)
        result.append(SkinSurface(layer.name, layer.x, layer.y, layer.time_ns, height, depth, layer.scale))
    if not result:
        flat = np.full((1, *sensor.map.shape), top, dtype=np.float32)
        scale = scale_of(np.zeros(1), "mm", floor=DEPTH_FLOOR)
        x, y, depth = sensor.map.x, sensor.map.y, np.zeros_like(flat)
        result.append(SkinSurface("undeformed", x, y, np.array([start_ns]), flat, depth, scale))
    return tuple(result)


def faces(sensor: Sensor, maps: tuple[DepthMaps, ...]) -> tuple[SkinSurface, ...]:
    """Return one face for each of some maps, under the map's name."""
    top = np.float32(sensor.skin.thickness)
    return tuple(SkinSurface(m.name, m.x, m.y, m.time_ns, top - m.values, m.values, m.scale) for m in maps)


def contact_cloud(surface: SkinSurface, threshold: float = DEPTH_FLOOR) -> Cloud:
    """Return the points of a skin that are pressed in by more than a threshold [mm], time by time."""
    touched = surface.depth.reshape(len(surface.depth), -1) > threshold
    return Cloud(
        "contact",
        surface.time_ns,
        touched.sum(axis=1),
        surface.vertices[touched],
        surface.depth.reshape(len(touched), -1)[touched],
        surface.scale,
        0.3 * float(surface.x[1] - surface.x[0]),
    )


def footprint(sensor: Sensor) -> np.ndarray:
    """Return the corners of the skin's block with its protrusions [mm], shape (2, 3)."""
    half = np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2
    return np.array([[*-half, -sensor.skin.protrusion_tip], [*half, sensor.skin.thickness]])


def indenter_body(sensor: Sensor, press: Press, time_ns: np.ndarray, tip: np.ndarray) -> Body:
    """Return the indenter at its nominal pose.

    Args:
        sensor: Gives the height of the undeformed face.
        press: Gives the shape and how it is turned.
        time_ns: Times [ns], shape (n,).
        tip: x, y and depth of the lowest point [mm], shape (n, 3).
    """
    mesh = press.indenter.surface()
    turn = Rotation.from_euler("XYZ", [press.tilt_x, press.tilt_y, press.yaw], degrees=True)
    # The depth is that of the lowest point; a body is placed by its origin, which is above it if it leans.
    leans = press.tilt_x or press.tilt_y
    rise = -float(turn.apply(np.asarray(mesh.vertices))[:, 2].min()) if leans else 0.0
    position = np.column_stack([tip[:, :2], sensor.skin.thickness - tip[:, 2] + rise])
    rows = thinning.strongest(tip[:, 2], thinning.ARRAYS)
    time_ns, position = time_ns[rows], position[rows]
    return Body("indenter", np.asarray(mesh.vertices), np.asarray(mesh.faces), turn.as_quat(), time_ns, position)
