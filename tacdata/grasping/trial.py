"""One trial: close, measure, move toward the band, measure again, lift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.grasping.strategies.strategy import Strategy
from tacdata.grasping.touch import Fingertip


@dataclass(frozen=True)
class Protocol:
    """How the hand proceeds: band, forces, moves, safety stops."""

    band: float = 2.0
    """Largest offset from the middle at which a contact is accepted [mm] (paper)."""
    window: float = 5.0
    """Time over which readings are averaged [s] (paper)."""
    force: float = 1.8
    """Normal force of each fingertip while it measures [N]."""
    largest_move: float = 2.0
    """Largest move of the arm per adjustment [mm]: half the band's width."""
    off: float = 0.1
    """Standard deviation of the arm's positioning error [mm]."""
    most: int = 20
    """Safety stop: largest number of adjustments; then the trial has failed [count]. The strategies know no limit."""
    reach: float = 12.0
    """Safety stop: largest distance of the arm from its start [mm]."""


@dataclass(frozen=True)
class Approach:
    """Result of the search for a position to grasp."""

    lateral: float
    """True offset of the orange from the gripper's middle at the end [mm]."""
    adjustments: int
    """Number of adjustments."""
    estimates: tuple[float, ...]
    """Estimated offset at each measurement [mm]."""
    truths: tuple[float, ...]
    """True offset at each measurement [mm]."""
    stopped: str
    """Why nothing is lifted, as a sentence; empty if it is lifted."""


def fused(fingers: Sequence[Fingertip], centres: Sequence[np.ndarray | None]) -> float | None:
    """Return the lateral offset in the gripper's frame [mm], averaged over the fingertips with an estimate."""
    offsets = [finger.side * float(c[0]) for finger, c in zip(fingers, centres, strict=True) if c is not None]
    return float(np.mean(offsets)) if offsets else None


def approach(
    fingers: Sequence[Fingertip],
    lateral: float,
    vertical: float,
    strategy: Strategy,
    protocol: Protocol,
    rate: float,
    rng: np.random.Generator,
) -> Approach:
    """Close, measure and move until the contact is estimated to lie in the band.

    Args:
        fingers: The two fingertips.
        lateral: Initial offset of the orange [mm].
        vertical: The same upwards [mm].
        strategy: Estimate of each fingertip's contact.
        protocol: How the hand proceeds.
        rate: Frames a second [Hz].
        rng: Random generator of the positioning errors.
    """
    start, count = lateral, round(protocol.window * rate)
    believed: list[float] = []
    true: list[float] = []

    def ended(why: str) -> Approach:
        return Approach(lateral, max(len(true) - 1, 0), tuple(believed), tuple(true), why)

    while True:
        windows = [finger.frames(lateral, vertical, protocol.force, count) for finger in fingers]
        true.append(lateral)
        offset = fused(fingers, [strategy.centre(window) for window in windows])
        if offset is None:
            return ended("no contact")
        believed.append(offset)
        if abs(offset) <= protocol.band:
            return ended("")
        if len(true) > protocol.most:
            return ended(f"safety stop after {protocol.most} adjustments")
        move = float(np.clip(offset, -protocol.largest_move, protocol.largest_move)) + rng.normal(0.0, protocol.off)
        if abs(lateral - move - start) > protocol.reach:
            return ended(f"safety stop: the arm would leave its {protocol.reach:g} mm")
        lateral -= move
