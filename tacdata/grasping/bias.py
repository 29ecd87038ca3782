"""Bias of each estimate of the contact's centre, by position, without noise on an ideal fingertip."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.grasping.centre import Maps, map_centre
from tacdata.grasping.press_set import PressSet
from tacdata.grasping.strategies import strategy as strategies
from tacdata.grasping.touch import OrangeTouch

STEP = 0.25
"""Spacing of the positions [mm]."""
FRAMES = 9
"""Identical frames of each window: a network's longest, so that it sees a contact at rest [count]."""


def bias(touch: OrangeTouch, presses: PressSet, maps: Maps, force: float, band: float) -> dict[str, Any]:
    """Return true and estimated lateral positions of the orange, middle first.

    Args:
        touch: The skin's answer to the orange.
        presses: The orange's presses, whose solved maps stand for a perfect network.
        maps: The trained network.
        force: Normal force [N].
        band: Half width within which a contact is accepted [mm].
    """
    sensor = touch.sensor
    true = np.arange(0.0, touch.limit[0] + 1e-9, STEP)
    windows = [np.repeat(touch.signals(x, 0.0, force)[None], FRAMES, axis=0) for x in true.tolist()]
    ways = {name: strategies.create(name, sensor, maps) for name in strategies.names()}
    believed = {
        **{name: [_x(way.centre(w)) for w in windows] for name, way in ways.items() if way.adjusts},
        "solved_map": [_x(map_centre(_solved(touch, presses, x, force), sensor)) for x in true.tolist()],
    }
    return {
        "true": true.tolist(),
        **believed,
        "accepted_to": {name: _accepted(true, values, band) for name, values in believed.items()},
        "toward_interior": {
            name: {
                f"{at:g}": None if (value := values[round(at / STEP)]) is None else at - value for at in (2.0, 4.0, 6.0)
            }
            for name, values in believed.items()
        },
    }


def _x(centre: np.ndarray | None) -> float | None:
    return None if centre is None else float(centre[0])


def _accepted(true: np.ndarray, values: list[float | None], band: float) -> float:
    """Return the farthest true position [mm] whose estimate is in the band, linear between grid points."""
    believed = np.array([np.nan if v is None else v for v in values])
    # A strategy may believe several places to be within the band; the farthest counts.
    inside = np.flatnonzero(believed <= band)
    last = int(inside[-1]) if len(inside) else 0
    if last + 1 >= len(true) or not believed[last + 1] > believed[last]:
        return float(true[last])
    share = (band - believed[last]) / (believed[last + 1] - believed[last])
    return float(true[last] + share * (true[last + 1] - true[last]))


def _solved(touch: OrangeTouch, presses: PressSet, x: float, force: float) -> np.ndarray:
    """Return the solved map at y = 0, linear between positions and depths [mm]."""
    depth, places = touch.depth(x, 0.0, force), presses.place
    rows = np.flatnonzero(np.abs(places[:, 1]) < 1e-9)
    at, levels = places[rows, 0], presses.depths[rows[0]]
    maps = presses.surface[rows].astype(float)
    right = min(max(int(np.searchsorted(at, x)), 1), len(at) - 1)
    above = min(max(int(np.searchsorted(levels, depth)), 1), len(levels) - 1)
    a, b = (
        (x - at[right - 1]) / (at[right] - at[right - 1]),
        (depth - levels[above - 1]) / (levels[above] - levels[above - 1]),
    )
    low, high = ((1 - b) * maps[k, above - 1] + b * maps[k, above] for k in (right - 1, right))
    return (1 - a) * low + a * high
