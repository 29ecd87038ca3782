"""Which moments of a scene a still picture shows."""

from __future__ import annotations

import numpy as np

from tacdata.viewers.scene.scene import DepthMaps, Scene


def moments(scene: Scene) -> tuple[tuple[str, int], ...]:
    """Return the name and time [ns] of up to three frames: half way in, deepest, half way out.

    They are found in the label's maps, else in the prediction's, else in the taxels' signal; a scene that never
    happens (in a recording that breaks off, say) is left out.
    """
    shown = scene.map_named("label") or scene.map_named("prediction") or next(iter(scene.maps), None)
    time = shown.time_ns if shown else scene.taxels.time_ns
    values = shown.values if shown else np.nan_to_num(np.abs(scene.taxels.values))
    strength = values.reshape(len(values), -1).max(axis=1)
    # A hold has many frames of nearly the same depth: its middle is shown, and not its noisiest frame.
    top = np.flatnonzero(strength >= 0.98 * strength.max())
    deepest = int(top[len(top) // 2])
    half = 0.5 * strength.max()
    before = np.flatnonzero(strength[:deepest] <= half)
    after = np.flatnonzero(strength[deepest:] <= half) + deepest
    found = [("half way in", int(before[-1]))] if len(before) else []
    found.append(("deepest", deepest))
    found += [("half way out", int(after[0]))] if len(after) else []
    return tuple((name, int(time[index])) for name, index in found)


def nearest(time_ns: np.ndarray, moment_ns: int) -> int:
    """Return the index of the time [ns], shape (n,), that is nearest to a moment [ns]."""
    return int(np.argmin(np.abs(time_ns - moment_ns)))


def picture_at(maps: DepthMaps, moment_ns: int) -> np.ndarray:
    """Return the map nearest to a moment [mm], shape (pixels_x, pixels_y)."""
    return maps.values[nearest(maps.time_ns, moment_ns)]
