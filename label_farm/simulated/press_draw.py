"""Draws the presses of a simulated dataset, each from the seed and its own number alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.indenters import Indenter, from_document
from tacdata.label_farm.simulated.plan import DrawnShape, Range, SimulationPlan, as_range
from tacdata.plans import Press
from tacdata.sensor import Sensor

_TRIES = 200
"""How often a press is drawn again before the plan counts as impossible."""
_PURPOSE = "simulated"
_STREAM = 41
"""Separates the random numbers of presses from those of specimens and noise."""


def draw_press(plan: SimulationPlan, sensor: Sensor, seed: int, number: int) -> Press:
    """Return press ``number`` of a simulated dataset: the same for the same plan, sensor and seed.

    Places are drawn evenly over the part of the map where the indenter at full depth keeps its distance from the rim.
    Sizes that make no solid, and solids that find no place, are drawn again.

    Raises:
        FormatError: If the plan's ranges hold no press that this skin can take.
    """
    # A stream for each press: a longer dataset begins with the shorter one.
    rng = np.random.default_rng([seed, _STREAM, number])
    weights = np.array([shape.weight for shape in plan.shapes])
    reason = ""
    for _ in range(_TRIES):
        drawn = plan.shapes[int(rng.choice(len(weights), p=weights / weights.sum()))]
        try:
            return _press(plan, drawn, sensor, rng, number)
        except FormatError as error:
            reason = error.given
    raise FormatError(
        f"plan {plan.name}: no press in {_TRIES} tries, the last: {reason}",
        f"sizes that make a solid, and presses within the {sensor.skin.size_x:g} x {sensor.skin.size_y:g} x "
        f"{sensor.skin.thickness:g} mm of {sensor.name}",
        "narrow the ranges of sizes and depths",
    )


def _press(plan: SimulationPlan, drawn: DrawnShape, sensor: Sensor, rng: np.random.Generator, number: int) -> Press:
    indenter = from_document(drawn_sizes(drawn.sizes, rng, drawn.name), f"plan {plan.name}: shapes/{drawn.name}")
    depth, yaw = _one(drawn.depth, rng), _one(plan.yaw, rng) % 360.0
    tilt_x, tilt_y = _one(plan.tilt, rng), _one(plan.tilt, rng)
    if depth >= sensor.skin.thickness:
        raise FormatError(f"a depth of {depth:g} mm", f"below {sensor.skin.thickness:g} mm", "press less deep")
    half = _room(indenter, depth, yaw, max(abs(tilt_x), abs(tilt_y)), sensor, plan.rim)
    x, y = (round(float(rng.uniform(-limit, limit)), 3) for limit in half)
    return Press(
        index=number,
        indenter=indenter,
        indenter_name=drawn.name,
        x=x,
        y=y,
        yaw=yaw,
        depth=depth,
        speed=_one(plan.speed, rng),
        hold=_one(plan.hold, rng),
        rest=_one(plan.rest, rng),
        recovery=_one(plan.recovery, rng),
        purpose=_PURPOSE,
        tilt_x=tilt_x,
        tilt_y=tilt_y,
    )


def drawn_sizes(values: dict[str, Any], rng: np.random.Generator, origin: str) -> dict[str, Any]:
    """Return an indenter's document with each range replaced by a number drawn from it; nested solids likewise."""
    sizes: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            sizes[name] = drawn_sizes(value, rng, origin)
        elif isinstance(value, list):
            sizes[name] = _one(as_range(value, f"shapes/{origin}/{name}"), rng)
        else:
            sizes[name] = value
    return sizes


def _one(values: Range, rng: np.random.Generator) -> float:
    return round(float(rng.uniform(*values)), 3)


def _room(indenter: Indenter, depth: float, yaw: float, tilt: float, sensor: Sensor, rim: float) -> np.ndarray:
    """Return how far from the middle the indenter may press along x and y [mm], shape (2,)."""
    # A leaning solid reaches as far as it is wide times the lean, deeper; twice the depth bounds it for small leans.
    reached = indenter.footprint(depth + np.tan(np.radians(tilt)) * indenter.extent, yaw)
    skin = np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2 - reached - rim
    edge = sensor.map.pixel_pitch * (np.array(sensor.map.shape) - 1) / 2
    if (skin < 0).any():
        raise FormatError(
            f"{indenter.shape} of {2 * max(reached):.1f} mm at {depth:g} mm depth", "one that fits", "shrink it"
        )
    return np.minimum(skin, edge)
