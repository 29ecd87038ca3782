"""Control arms of a replay: the same targets, moved by something else than depth.

Compensation by depth may hold an object because it presses harder, and not because of the measured touch. Each arm
takes away a part of the information and keeps the rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.replay.grasp import LEAST_DEPTH
from tacdata.replay.outcome import normals
from tacdata.replay.targets import FingertipTargets

CLOSING = 0.001
"""Displacement of the arm `CLOSE` while a finger touches [m]."""
DIRECT, CLOSE, CONSTANT, TAXELS, DEPTH = "direct", "close 1 mm", "constant", "raw taxels", "compensated"
MEANINGS = {
    DIRECT: "targets as seen",
    CLOSE: "moved by 1 mm while a finger touches",
    CONSTANT: "moved while a finger touches, as far on average as by depth",
    TAXELS: "moved by the sum of the readings, as far on average as by depth",
    DEPTH: "moved by the predicted depth",
}
"""Arm -> its targets, in words."""
CONTROLS = CLOSE, CONSTANT, TAXELS
"""Arms that use touch but no depth."""


def control_arms(
    direct: FingertipTargets, compensated: FingertipTargets, readings: np.ndarray | None
) -> dict[str, FingertipTargets]:
    """Return the arms of `CONTROLS`, the one by readings only where there are some.

    Args:
        direct: Targets as seen, with the predicted depth.
        compensated: The same, moved by depth.
        readings: Sum of each finger's tared readings [counts], shape (n, f); None without.
    """
    outward, touch = normals(direct), np.nan_to_num(direct.depth) > LEAST_DEPTH
    shift = ((compensated.position - direct.position) * outward).sum(axis=-1)
    mean = float(shift[touch].mean()) if touch.any() else 0.0
    displacements = {CLOSE: CLOSING * touch, CONSTANT: mean * touch}
    if readings is not None:
        level = np.maximum(np.nan_to_num(readings), 0.0)
        usual = float(level[touch].mean()) if touch.any() else 0.0
        if usual > 0:
            displacements[TAXELS] = mean * level / usual
    return {
        name: replace(direct, position=direct.position + by[..., None] * outward) for name, by in displacements.items()
    }
