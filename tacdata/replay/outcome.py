"""Simulates an object and fingertips that follow targets: springs pull them, contact pushes back.

A fingertip is a soft sphere held by springs (the compliance of joints and controllers; an infinitely stiff robot would
need no compensation). A direct replay brings the pads to where they were seen, so that the springs hardly press.
Targets that are moved into the object stretch them. Coulomb friction and gravity in MuJoCo decide whether the object is
lifted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import UsageError
from tacdata.replay.grasp import touching
from tacdata.replay.scene import ReplayScene
from tacdata.replay.scene_model import PAD, SceneModel
from tacdata.replay.targets import FingertipTargets

HIGH = 0.9
"""Share of the fingers' lift above which they count as high [1]."""
HELD = 0.5
"""The object is held if it never sinks below this share of the fingers' lift while they are high [1]."""
LEAST_LIFT = 0.01
"""Smallest lift, and smallest movement of a wipe, that counts [m]."""
BEHIND = 0.015
"""Distance behind the fingers from which an eraser is lost [m]."""


@dataclass(frozen=True, eq=False)
class ReplayOutcome:
    """Result of a replay."""

    held: bool
    lift: float
    """Lowest height of the ball above its start, while the fingers are high [m]."""
    force: dict[str, float]
    """Finger -> mean normal force in that time [N]."""
    depth: dict[str, float]
    """Finger -> mean depth of the simulated skin in that time [mm]."""
    time: np.ndarray
    """Times of the replay [s], shape (n,)."""
    ball: np.ndarray
    """Centre of the ball [m], shape (n, 3)."""
    tips: np.ndarray
    """Centres of the fingertips' pads [m], shape (n, f, 3)."""
    slip: float = 0.0
    """Distance of an eraser behind the fingertips along the strokes [m]; 0 for a ball."""


def ball_centre(targets: FingertipTargets, touch: int, radius: float) -> np.ndarray:
    """Return a ball's centre in a row in which all fingers touch it [m], shape (3,).

    Each pad touches the ball, so the centre lies a radius along its normal, less the depth that it felt.
    """
    reach = (radius - np.nan_to_num(targets.depth[touch]) / 1000)[:, None]
    return (targets.seen[touch] + reach * normals(targets)[touch]).mean(axis=0)


def normals(targets: FingertipTargets) -> np.ndarray:
    """Return the normals out of the pads [1], shape (n, f, 3)."""
    x, y, z, w = np.moveaxis(targets.quaternion, -1, 0)
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)


def replay_targets(targets: FingertipTargets, scene: ReplayScene, centre: np.ndarray) -> ReplayOutcome:
    """Return the outcome of a replay for an object whose centre starts at ``centre`` [m].

    A ball is held if it stays high while the fingers are. An eraser is held if it never falls behind the fingers'
    strokes.

    Raises:
        UsageError: If the targets do not lift, or wipe.
    """
    pads = targets.position - PAD * normals(targets)
    high = _high(pads) if scene.task == "grasp" else _wiping(pads, targets)
    if scene.bias:
        pads = pads + np.array(scene.bias)
    ground = np.array(centre) + scene.place
    seconds = (targets.time_ns - targets.time_ns[0]) * 1e-9
    path = SceneModel(scene, pads[0], ground).run(pads, seconds)
    lowest = float((path.ball[high, 2] - ground[2]).min())
    force = {name: float(path.force[high, k].mean()) for k, name in enumerate(targets.fingers)}
    depth = {name: float(1000 * path.depth[high, k].mean()) for k, name in enumerate(targets.fingers)}
    slip = 0.0
    if scene.task == "grasp":
        held = lowest > HELD * _lift(pads)
    else:
        slip = _slip(path.tips[high].mean(axis=1), path.ball[high])
        held = slip < BEHIND
    return ReplayOutcome(bool(held), lowest, force, depth, seconds, path.ball, path.tips, slip)


def _lift(pads: np.ndarray) -> float:
    return float(np.ptp(pads[..., 2].mean(axis=1)))


def _high(pads: np.ndarray) -> np.ndarray:
    height, lift = pads[..., 2].mean(axis=1), _lift(pads)
    if lift < LEAST_LIFT:
        raise UsageError(f"targets that rise by {1000 * lift:.0f} mm", "10 mm or more", "replay a demonstrated grasp")
    return height > height.min() + HIGH * lift


def _wiping(pads: np.ndarray, targets: FingertipTargets) -> np.ndarray:
    """Return the rows from the first stroke to the last: while all fingers touch."""
    rows = touching(targets)
    rows[np.argmax(rows) : len(rows) - np.argmax(rows[::-1])] = rows.any()
    stroke = np.ptp(pads[rows].mean(axis=1), axis=0).max() if rows.any() else 0.0
    if stroke < LEAST_LIFT:
        raise UsageError(f"targets that wipe {1000 * stroke:.0f} mm", "10 mm or more", "replay a demonstrated wipe")
    return rows


def _slip(fingers: np.ndarray, eraser: np.ndarray) -> float:
    """Return the distance of the eraser behind the fingers, along their main direction of movement [m]."""
    moved = fingers - fingers[0]
    along = np.linalg.svd(moved - moved.mean(axis=0), full_matrices=False)[2][0]
    return float(np.abs((eraser - eraser[0] - moved) @ along).max())
