"""Maps of an episode: depth by label and prediction on one scale, their difference, pressure and shear.

Pressure is shown twice: that of the indenter on the skin, and that of the protrusions on the board.
"""

from dataclasses import replace

import numpy as np

from tacdata.sensor import Sensor
from tacdata.sensor.protrusion_pixels import PIXELS, ProtrusionPixels
from tacdata.viewers.scene import thinning
from tacdata.viewers.scene.color_scale import scale_of
from tacdata.viewers.scene.scene import Curves, DepthMaps

DEPTH_FLOOR = 0.1
"""Least end of the depth scale [mm]: below the paper's contact threshold there is nothing to see."""
ERROR_FLOOR = 0.05
"""Least end of the error scale [mm]."""

CONTACT_FLOOR = 1.0
"""Least end of the scales of pressure and shear [kPa]: without friction there is nothing to see."""


def depth_maps(
    sensor: Sensor, label: tuple[np.ndarray, np.ndarray] | None, prediction: tuple[np.ndarray, np.ndarray] | None
) -> tuple[DepthMaps, ...]:
    """Return the maps called "label", "prediction" and, for frames that both hold, "error".

    Args:
        sensor: Gives the pixel grid.
        label: Times [ns], shape (n,), and depth [mm], shape (n, pixels_x, pixels_y); or None.
        prediction: The same of a network.
    """
    pairs = {name: pair for name, pair in (("label", label), ("prediction", prediction)) if pair is not None}
    if not pairs:
        return ()
    # One scale for both, or equal depths would have different colours.
    scale = scale_of(np.array([depth.max(initial=0.0) for _, depth in pairs.values()]), "mm", floor=DEPTH_FLOOR)
    x, y = sensor.map.x, sensor.map.y
    maps = [DepthMaps(name, x, y, time, depth, scale) for name, (time, depth) in pairs.items()]
    if label is not None and prediction is not None:
        time, ours, theirs = np.intersect1d(label[0], prediction[0], return_indices=True)
        if len(time):
            error = (prediction[1][theirs] - label[1][ours]).astype(np.float32)
            maps.append(DepthMaps("error", x, y, time, error, scale_of(error, "mm", signed=True, floor=ERROR_FLOOR)))
    return tuple(maps)


def contact_maps(sensor: Sensor, time_ns: np.ndarray, traction: np.ndarray) -> tuple[DepthMaps, ...]:
    """Return maps called "pressure" and "shear" [kPa], on a scale each.

    Args:
        sensor: Gives the pixel grid.
        time_ns: Times [ns], shape (n,).
        traction: Contact force on the indenter by area of the map [MPa], shape (n, 3, pixels_x, pixels_y).
    """
    pressure, shear = traction[:, 2].astype(np.float32), np.linalg.norm(traction[:, :2].astype(np.float32), axis=1)
    return tuple(
        DepthMaps(name, sensor.map.x, sensor.map.y, time_ns, values, scale_of(values, "kPa", floor=CONTACT_FLOOR))
        for name, values in (("pressure", 1e3 * pressure), ("shear", 1e3 * shear))
    )


def board_map(sensor: Sensor, time_ns: np.ndarray, pressure: np.ndarray) -> DepthMaps:
    """Return the map called "board" [kPa]: each protrusion's pressure at its place, to half of a pixel.

    Args:
        sensor: Gives the protrusions' places.
        time_ns: Times [ns], shape (n,).
        pressure: Of each protrusion on the board [MPa], shape (n, taxels, PIXELS, PIXELS).
    """
    pitch, centers = ProtrusionPixels(sensor.skin.protrusion_radius).pitch, sensor.taxels.centers
    corner = np.rint((centers - centers.min(axis=0)) / pitch).astype(int)
    shape = corner.max(axis=0) + PIXELS
    x, y = (pitch * (np.arange(count) - (count - 1) / 2) for count in shape)
    values = np.zeros((len(time_ns), *shape), np.float32)
    for (i, j), series in zip(corner, np.moveaxis(pressure, 1, 0), strict=True):
        values[:, i : i + PIXELS, j : j + PIXELS] += 1e3 * series.astype(np.float32)
    return DepthMaps("board", x, y, time_ns, values, scale_of(values, "kPa", floor=CONTACT_FLOOR))


def error_curves(maps: tuple[DepthMaps, ...]) -> tuple[Curves, ...]:
    """Return the root mean square over all pixels and the largest difference of each frame [mm]."""
    error = next((m for m in maps if m.name == "error"), None)
    if error is None:
        return ()
    root_mean_square = np.sqrt(np.mean(error.values.astype(float) ** 2, axis=(1, 2)))
    largest = np.abs(error.values).max(axis=(1, 2))
    values = np.stack([root_mean_square, largest], axis=1)
    return (Curves("error", "mm", ("root mean square", "largest"), error.time_ns, values),)


def thinned(maps: tuple[DepthMaps, ...], limit: int = thinning.MAPS) -> tuple[DepthMaps, ...]:
    """Return maps of at most ``limit`` times, about the same times for all of them: the deepest of each stretch."""
    if not maps or max(len(m.time_ns) for m in maps) <= limit:
        return maps
    first = max(maps, key=lambda m: len(m.time_ns))
    flat = first.values.reshape(len(first.values), -1)
    strength = np.maximum(flat.max(axis=1), -flat.min(axis=1))
    # The map with the most times decides, so that label and prediction stay comparable frame by frame.
    times = first.time_ns[thinning.strongest(strength, limit)]
    result = []
    for m in maps:
        rows = np.flatnonzero(np.isin(m.time_ns, times))
        if not len(rows):
            rows = thinning.evenly(len(m.time_ns), limit)
        result.append(replace(m, time_ns=m.time_ns[rows], values=m.values[rows]))
    return tuple(result)
