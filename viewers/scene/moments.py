"""Which moments of a scene a still picture shows."""

import numpy as np

from tacdata.viewers.scene.scene import DepthMaps, Scene


def moments(scene: Scene) -> tuple[tuple[str, int], ...]:
    """Return the name and time [ns] of up to three frames: half way in, deepest, half way out.

    They are found in the label's maps, else in the prediction's, else in the taxels' signal; a scene that never
    happens (in a recording that breaks off, say) is left out.
    """
    layer = scene.map_named("label") or scene.map_named("prediction") or next(iter(scene.maps), None)
    time = layer.time_ns if layer else scene.taxels.time_ns
    values = layer.values if layer else np.nan_to_num(np.abs(scene.taxels.values))
    strength = values.reshape(len(values), -1).max(axis=1)
    # A hold has many frames of nearly the same depth: its middle is shown, and not its noisiest frame.
    top = np.flatnonzero(strength >= 0.98 * strength.max())
    deepest = int(top[len(top) // 2])
    half = 0.5 * strength.max()
    rising = np.flatnonzero(strength[:deepest] <= half)
    falling = np.flatnonzero(strength[deepest:] <= half) + deepest
    marks = [("half way in", int(rising[-1]))] if len(rising) else []
    marks.append(("deepest", deepest))
    marks += [("half way out", int(falling[0]))] if len(falling) else []
    return tuple((name, int(time[index])) for name, index in marks)


def nearest(time_ns: np.ndarray, moment_ns: int) -> int:
    """Return the index of the time [ns], shape (n,), that is nearest to a moment [ns]."""
    return int(np.argmin(np.abs(time_ns - moment_ns)))


def picture_at(maps: DepthMaps, moment_ns: int) -> np.ndarray:
    """Return the map nearest to a moment [mm], shape (pixels_x, pixels_y)."""
    return maps.values[nearest(maps.time_ns, moment_ns)]
