"""The presses of the study: of the object that it grasps, and of others for training."""

from __future__ import annotations

import numpy as np

from tacdata.indenters import Indenter, from_document
from tacdata.sensor import Sensor
from tacdata.skin.press import PressRequest

RADIUS = 35.0
"""Radius of the orange [mm]."""
UNIT = 0.013
"""Unit of the depths [mm]: each is the unit times a square, as a contact's force grows."""
STATES = 8
"""Depths of a press, the undeformed state included [count]."""
PLACES_X, PLACES_Y, SPACING = 11, 4, 0.75
"""Positions of the orange along x and y, from the middle outwards, and their spacing [mm]. The skin is symmetric, so a
quarter suffices.
"""
RADII = (4.0, 90.0)
"""Smallest and largest radius for training [mm]."""
LEFT_OUT = (25.0, 50.0)
"""Radii left out of training [mm]. The orange's is among them, so the network has never seen it."""
ROUND = 0.8
"""Share of spheres in the training set; the others are ellipsoids [1]."""
TRAINING = 140
"""Number of training presses that ship [count]; each counts four times, mirrored."""
BEYOND = 0.5
"""Smallest distance of training contacts from the skin's edge [mm]."""
SHALLOWEST, DEEPEST, SHARP, SHARP_DEEPEST = 0.3, 0.64, 12.0, 1.0
"""Smallest and largest depth for training; radius below which a shape is sharp, and the largest depth of sharp ones
[mm].
"""


def orange(radius: float = RADIUS) -> Indenter:
    """Return the object: a sphere [mm]."""
    return from_document({"shape": "sphere", "radius": radius}, "orange")


def orange_places() -> tuple[np.ndarray, np.ndarray]:
    """Return the positions' x, shape (a,), and y, shape (b,) [mm], from 0."""
    return SPACING * np.arange(PLACES_X), SPACING * np.arange(PLACES_Y)


def orange_presses() -> list[PressRequest]:
    """Return the presses of the orange, y running fastest."""
    depths = tuple((UNIT * np.arange(STATES) ** 2).round(6).tolist())
    x, y = orange_places()
    return [PressRequest(orange(), a, b, 0.0, depths) for a in x.tolist() for b in y.tolist()]


def training_presses(sensor: Sensor, count: int) -> list[PressRequest]:
    """Return presses of spheres and ellipsoids at random positions, also beyond edges.

    Args:
        sensor: The skin.
        count: Number of presses; the same at every call.
    """
    rng = np.random.default_rng([0, 31])
    # Contacts reach over the edge, as they do in a gripper.
    half = np.array([sensor.skin.size_x, sensor.skin.size_y]) / 2 - BEYOND
    requests = []
    for _ in range(count):
        x, y = rng.uniform(-half, half).round(3).tolist()
        round_one, radii = rng.random() < ROUND, [_radius(rng) for _ in range(2)]
        sharp = max(radii[: 1 if round_one else 2]) <= SHARP
        deepest = float(rng.uniform(SHALLOWEST, SHARP_DEEPEST if sharp else DEEPEST))
        depths = tuple((deepest * np.linspace(0, 1, STATES) ** 2).round(6).tolist())
        yaw = 0.0 if round_one else float(rng.uniform(0.0, 180.0).__round__(1))
        requests.append(PressRequest(_shape(round_one, radii), x, y, yaw, depths))
    return requests


def _radius(rng: np.random.Generator) -> float:
    while True:
        # Evenly in the logarithm: a map changes with the ratio of two radii.
        radius = float(np.exp(rng.uniform(*np.log(RADII))))
        if not LEFT_OUT[0] <= radius <= LEFT_OUT[1]:
            return round(radius, 2)


def _shape(round_one: bool, radii: list[float]) -> Indenter:
    if round_one:
        return from_document({"shape": "sphere", "radius": radii[0]}, "sphere")
    a, b = radii
    return from_document({"shape": "ellipsoid", "a": a, "b": b, "c": min(a, b)}, "ellipsoid")
