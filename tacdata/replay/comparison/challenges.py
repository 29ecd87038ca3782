"""Scenes unlike the demonstration: changes that a robot meets when it repeats one on another day."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tacdata.replay.scene import ReplayScene


@dataclass(frozen=True)
class Challenge:
    """One way in which the world differs."""

    change: Callable[[ReplayScene, np.random.Generator], ReplayScene]
    """Scene of a seed, and random numbers of that seed -> the scene that is replayed in."""
    fragile: bool = False
    """Whether the object breaks above its strength."""


def _wider(by: float) -> Callable[[ReplayScene, np.random.Generator], ReplayScene]:
    def change(scene: ReplayScene, rng: np.random.Generator) -> ReplayScene:
        first, *remainder = scene.body.sizes
        return replace(scene, body=replace(scene.body, sizes=(first + by, *remainder)))

    return change


def _shifted(by: float) -> Callable[[ReplayScene, np.random.Generator], ReplayScene]:
    def change(scene: ReplayScene, rng: np.random.Generator) -> ReplayScene:
        angle = rng.uniform(0, 2 * np.pi)
        x, y, z = scene.place
        return replace(scene, place=(x + by * np.cos(angle), y + by * np.sin(angle), z))

    return change


def _cameras(spread: float) -> Callable[[ReplayScene, np.random.Generator], ReplayScene]:
    def change(scene: ReplayScene, rng: np.random.Generator) -> ReplayScene:
        # Per axis: the root mean square length of the error in space is then ``spread``.
        deviation = rng.normal(0, spread / np.sqrt(3), (len(scene.bias), 3)) + np.array(scene.bias)
        return replace(scene, bias=tuple((a, b, c) for a, b, c in deviation.tolist()))

    return change


CHALLENGES = {
    "as demonstrated": Challenge(lambda scene, rng: scene),
    "3 mm smaller": Challenge(_wider(-0.003)),
    "3 mm larger": Challenge(_wider(0.003)),
    "1.5 times the mass": Challenge(lambda scene, rng: replace(scene, mass=1.5 * scene.mass)),
    "0.6 times the friction": Challenge(lambda scene, rng: replace(scene, friction=0.6 * scene.friction)),
    "fragile": Challenge(lambda scene, rng: scene, fragile=True),
    "fragile, 3 mm larger": Challenge(_wider(0.003), fragile=True),
    "shifted by 3 mm": Challenge(_shifted(0.003)),
    "cameras off by 4 mm": Challenge(_cameras(0.004)),
}
"""Challenge -> its change of the drawn scene."""


def changed(name: str, scene: ReplayScene, seed: int) -> ReplayScene:
    """Return the scene of a challenge and a seed, from the one that the seed drew."""
    # Random numbers of its own: a challenge must not change the scene that the seed drew.
    return CHALLENGES[name].change(scene, np.random.default_rng([seed, 41]))
