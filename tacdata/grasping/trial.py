"""One trial: close, measure, move toward the band, measure again, and in the end lift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tacdata.grasping.strategies.strategy import Strategy
from tacdata.grasping.touch import Fingertip


@dataclass(frozen=True)
class Protocol:
    """How the hand proceeds."""

    band: float = 2.0
    """Contacts within this of the middle are accepted [mm] (paper)."""
    window: float = 5.0
    """Time over which readings are averaged [s] (paper)."""
    force: float = 1.8
    """Normal force of each fingertip while it measures [N]."""
    largest_move: float = 2.0
    """No adjustment moves the arm farther [mm]: half the band's width."""
    off: float = 0.1
    """Standard deviation of where the arm comes to a halt [mm]."""
    most: int = 20
    """Safety stop: after so many adjustments the trial ends as failed [count]; the strategies know no limit."""
    reach: float = 12.0
    """Safety stop: the arm moves no farther than this from where it began [mm]."""


@dataclass(frozen=True)
class Approach:
    """How the search for a place to grasp ended."""

    lateral: float
    """Where the orange then truly lies beside the gripper's middle [mm]."""
    adjustments: int
    """How often the arm moved."""
    estimates: tuple[float, ...]
    """What was believed at each measurement [mm]."""
    truths: tuple[float, ...]
    """What was true at each [mm]."""
    stopped: str
    """Why nothing is lifted, in words; empty if it is."""


def fused(fingers: Sequence[Fingertip], centres: Sequence[np.ndarray | None]) -> float | None:
    """Return the lateral offset in the gripper's frame [mm], averaged over the fingertips that know one."""
    known = [finger.side * float(c[0]) for finger, c in zip(fingers, centres, strict=True) if c is not None]
    return float(np.mean(known)) if known else None


def approach(
    fingers: Sequence[Fingertip], lateral: float, vertical: float, strategy: Strategy, protocol: Protocol,
    rate: float, rng: np.random.Generator,
) -> Approach:  # fmt: skip
    """Close, measure and move until the contact is believed to lie in the band.

    Args:
        fingers: The two fingertips.
        lateral: Where the orange lies at first [mm].
        vertical: The same upwards [mm].
        strategy: Where each fingertip believes the contact to be.
        protocol: How the hand proceeds.
        rate: Frames a second [Hz].
        rng: Decides where the arm comes to a halt.
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
