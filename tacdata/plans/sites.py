"""Sites on a skin: grids, taxels, gaps between them, the edge, random places."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.indenters import from_document
from tacdata.sensor import Sensor

MARGIN = 0.5
"""Default distance of grids and random places from the array's box, inwards [mm]."""


def sites(description: dict[str, Any], sensor: Sensor, rng: np.random.Generator, origin: str) -> np.ndarray:
    """Return the places of a block of a recipe.

    Args:
        description: ``{"kind": name, ...}`` as in `schemas/plan_recipe.schema.json`.
        sensor: The skin.
        rng: Random generator.
        origin: Names the block in errors.

    Returns:
        Sites [mm, sensor frame], shape (n, 2).

    Raises:
        FormatError: If the description lacks an entry of its kind, or names a taxel that does not exist.
    """
    values = dict(description)
    kind = values.pop("kind")
    try:
        return np.asarray(KINDS[kind](sensor, rng, **values), dtype=float).reshape(-1, 2)
    except TypeError as error:
        raise FormatError(
            f"{origin}: at: kind {kind} with {', '.join(values) or 'nothing else'} ({error})",
            NEEDS[kind],
            "correct the block's at",
        ) from None
    except IndexError:
        raise FormatError(
            f"{origin}: at: taxels {values.get('only')}",
            f"0 to {sensor.taxels.count - 1}",
            "name taxels that the sensor has",
        ) from None


def clear_of_rim(presses: list[dict[str, Any]], indenters: dict[str, Any], sensor: Sensor, clearance: float) -> None:
    """Move presses of a plan's document inwards, in place, so that none comes near the skin's rim.

    Args:
        presses: The document's presses.
        indenters: The document's indenters.
        sensor: The skin; its frame holds the rim.
        clearance: Minimum distance of each indenter at full depth from the rim [mm].
    """
    half = np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2
    for press in presses:
        indenter = from_document(indenters[press["indenter"]], press["indenter"])
        deepest = press["depth"] + press.get("overshoot", 0.0)
        # An indenter that is too wide for its skin can only press the middle.
        rim = np.maximum(half - indenter.footprint(deepest, press.get("yaw", 0.0)) - clearance, 0.0)
        press["x"], press["y"] = (
            round(float(np.clip(press[axis], -limit, limit)), 3) for axis, limit in zip("xy", rim, strict=True)
        )


def half_box(sensor: Sensor, margin: float = 0.0) -> np.ndarray:
    """Return half the extent of the array's box, taxel centre to taxel centre, less a margin [mm], shape (2,)."""
    taxels = sensor.taxels
    half = np.array([taxels.pitch_x * (taxels.columns - 1), taxels.pitch_y * (taxels.rows - 1)]) / 2
    return np.maximum(half - margin, 0.0)


def _points(sensor: Sensor, rng: np.random.Generator, points: list[list[float]]) -> Any:
    return points


def _center(sensor: Sensor, rng: np.random.Generator) -> Any:
    return [(0.0, 0.0)]


def _grid(sensor: Sensor, rng: np.random.Generator, columns: int, rows: int, margin: float = MARGIN) -> Any:
    half = half_box(sensor, margin)
    x, y = (np.linspace(-h, h, n) if n > 1 else np.zeros(1) for h, n in zip(half, (columns, rows), strict=True))
    return np.stack(np.meshgrid(x, y, indexing="xy"), axis=-1)


def _taxels(sensor: Sensor, rng: np.random.Generator, only: list[int] | None = None) -> Any:
    return sensor.taxels.centers if only is None else sensor.taxels.centers[only]


def _between(sensor: Sensor, rng: np.random.Generator, count: int | None = None) -> Any:
    """Half way to the neighbour along x, along y and along both, in this order for each taxel."""
    taxels = sensor.taxels
    shift = np.array([taxels.pitch_x, taxels.pitch_y]) / 2
    middles = (taxels.centers[:, None] + shift * np.array([[1, 0], [0, 1], [1, 1]])).reshape(-1, 2)
    inside = middles[(np.abs(middles) <= half_box(sensor) + 1e-9).all(axis=1)]
    # Drawn without repetition, then put back into the order of the taxels.
    return inside if count is None else inside[np.sort(rng.permutation(len(inside))[:count])]


def _random(sensor: Sensor, rng: np.random.Generator, count: int, margin: float = MARGIN) -> Any:
    half = half_box(sensor, margin)
    return rng.uniform(-half, half, (count, 2))


def _edge(sensor: Sensor, rng: np.random.Generator, count: int, beyond: float = 0.0) -> Any:
    """Equally spaced along the array's box, widened by ``beyond`` [mm]."""
    a, b = half_box(sensor) + beyond
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]])
    # Distance along the outline at each corner.
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    place = np.arange(count) / count * arc[-1]
    return np.stack([np.interp(place, arc, corners[:, axis]) for axis in range(2)], axis=-1)


KINDS: dict[str, Callable[..., Any]] = {
    "points": _points,
    "center": _center,
    "grid": _grid,
    "taxels": _taxels,
    "between": _between,
    "random": _random,
    "edge": _edge,
}
NEEDS = {
    "points": "points: a list of [x, y] in mm",
    "center": "nothing else",
    "grid": "columns, rows, perhaps margin",
    "taxels": "nothing else, or only: a list of taxels",
    "between": "nothing else, or count",
    "random": "count, perhaps margin",
    "edge": "count, perhaps beyond",
}
