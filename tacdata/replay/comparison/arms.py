"""Control arms of a replay: the same targets, moved by something else than depth.

Compensation by depth may hold an object because it presses harder, and not because of the measured touch. Each arm
takes away a part of the information and keeps the rest.
"""

from __future__ import annotations

from dataclasses import replace

from tacdata.replay.grasp import touched
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


def control_arms(direct: FingertipTargets, compensated: FingertipTargets) -> dict[str, FingertipTargets]:
    """Return the arms of `CONTROLS`.

    Args:
        direct: Targets as seen, with readings.
        compensated: The same, moved by depth.

    Raises:
        UsageError: If a finger has no readings.
    """
    # Touch is judged by readings: these arms know nothing of depth but its mean.
    outward, (level, touch) = direct.normals, touched(direct)
    shift = ((compensated.position - direct.position) * outward).sum(axis=-1)
    mean = float(shift[touch].mean()) if touch.any() else 0.0
    usual = float(level[touch].mean()) if touch.any() else 1.0
    displacements = {CLOSE: CLOSING * touch, CONSTANT: mean * touch, TAXELS: mean * level / usual}
    return {
        name: replace(direct, position=direct.position + by[..., None] * outward) for name, by in displacements.items()
    }
