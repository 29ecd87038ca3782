"""Simulates an object and fingertips that follow targets: springs pull them, contact pushes back.

A fingertip is a soft sphere held by springs (the compliance of joints and controllers; an infinitely stiff robot would
need no compensation). A direct replay brings the pads to where they were seen, so that the springs hardly press.
Targets that are moved into the object stretch them. Coulomb friction and gravity in MuJoCo decide whether the object is
held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.errors import UsageError
from tacdata.replay.grasp import touching
from tacdata.replay.scene import ReplayScene
from tacdata.replay.scene_model import PAD, Feedback, FreePads, PadDrive, Rollout, SceneModel
from tacdata.replay.targets import FingertipTargets

HIGH = 0.9
"""Share of the fingers' lift above which they count as high [1]."""
HELD = 0.5
"""The object is held if it never sinks below this share of the fingers' lift while they are high [1]."""
LEAST_LIFT = 0.01
"""Smallest lift, and smallest movement of a wipe, that counts [m]."""
BEHIND = 0.015
"""Distance behind the fingers from which an object is lost [m]."""


@dataclass(frozen=True, eq=False)
class ReplayOutcome:
    """Result of a replay."""

    held: bool
    lift: float
    """Lowest height of the object above its start, while the fingers are high [m]."""
    force: dict[str, float]
    """Finger -> mean normal force in that time [N]."""
    depth: dict[str, float]
    """Finger -> mean depth of the simulated skin in that time [mm]."""
    grip: float
    """Grip factor [1]: friction that all pads together can carry over the load, median while all touch, until it is
    lost. Below 1 the object cannot be held.
    """
    slip: float
    """Largest distance that the object has slid along a pad, from the full touch until it ends or is lost [m]."""
    behind: float
    """Largest distance of the object behind the fingers in that time [m]: in height, or along the strokes of a wipe."""
    decided: float
    """Time at which the verdict falls [s]: when the object is lost, or when the lift or the wipe has ended."""
    scene: ReplayScene
    fingers: tuple[str, ...]
    """Order of the fingers in the arrays, f of them."""
    time: np.ndarray
    """Times of the replay [s], shape (n,)."""
    path: Rollout
    """Motion, forces and slip at these times."""

    @property
    def hardest(self) -> float:
        """Largest force of a pad on the object until the verdict [N]."""
        return float(self.path.force[self.time <= self.decided].max())

    @property
    def reason(self) -> str:
        """Why the object was held or lost, in a sentence."""
        carried, load = self.grip * self.scene.load, self.scene.load
        need = "it weighs" if self.scene.task == "grasp" else "the wipe drags with"
        how = f"friction at the pads can carry {carried:.1f} N, {need} {load:.1f} N"
        slid = f"it slid by {1000 * self.slip:.1f} mm along a pad"
        if self.held:
            return f"held: {how} ({self.grip:.1f} times), {slid}"
        if self.grip < 1:
            return f"lost at {self.decided:.1f} s: {how}"
        return f"lost at {self.decided:.1f} s, though {how}: {slid}"


def replay_targets(
    targets: FingertipTargets,
    scene: ReplayScene,
    centre: np.ndarray,
    feedback: Feedback | None = None,
    hand: PadDrive | None = None,
) -> ReplayOutcome:
    """Return the outcome of a replay for an object whose centre starts at ``centre`` [m].

    With ``feedback``, a controller moves the targets by the readings of the simulated skin. Without ``hand``, pads
    without links follow the targets.

    An object that is lifted is held if it stays high while the fingers are. An eraser is held if it never falls behind
    the fingers' strokes.

    Raises:
        UsageError: If the targets do not lift, or wipe.
    """
    pads = targets.position - PAD * targets.normals
    wiped, touch = scene.task == "wipe", touching(targets)
    high = _wiping(pads, touch) if wiped else _high(pads)
    if scene.bias:
        pads = pads + np.array(scene.bias)
    ground = np.array(centre) + scene.place
    seconds = (targets.time_ns - targets.time_ns[0]) * 1e-9
    path = SceneModel(scene, hand or FreePads(pads[0]), ground).run(pads, seconds, feedback)
    # The verdict falls once the lift or the wipe has ended: letting go is no loss.
    first, last = int(np.argmax(touch)), int(np.flatnonzero(high)[-1])
    lag = _behind(path.tips.mean(axis=1), path.centre, first, high if wiped else None)
    lowest = float((path.centre[high, 2] - ground[2]).min())
    if wiped:
        success = lag[: last + 1].max() < BEHIND
    else:
        success = lowest > HELD * _lift(pads)
    failures = np.flatnonzero(lag[: last + 1] > BEHIND)
    end = last if success or not len(failures) else int(failures[0])
    rows = slice(min(first, end), end + 1)
    # The grip counts while the person holds the object; a loss may come before all fingers touch.
    pressing = path.force[rows].sum(axis=1)[touch[rows]] if touch[rows].any() else path.force[rows].sum(axis=1)
    names = targets.fingers
    return ReplayOutcome(
        bool(success),
        lowest,
        dict(zip(names, path.force[high].mean(axis=0).tolist(), strict=True)),
        dict(zip(names, (1000 * path.depth[high].mean(axis=0)).tolist(), strict=True)),
        float(scene.friction * np.median(pressing) / scene.load),
        float(np.linalg.norm(path.slid[rows] - path.slid[rows.start], axis=-1).max()),
        float(lag[rows].max()),
        float(seconds[end]),
        scene,
        names,
        seconds,
        path,
    )


def _lift(pads: np.ndarray) -> float:
    return float(np.ptp(pads[..., 2].mean(axis=1)))


def _high(pads: np.ndarray) -> np.ndarray:
    height, lift = pads[..., 2].mean(axis=1), _lift(pads)
    if lift < LEAST_LIFT:
        raise UsageError(f"targets that rise by {1000 * lift:.0f} mm", "10 mm or more", "replay a demonstrated grasp")
    return height > height.min() + HIGH * lift


def _wiping(pads: np.ndarray, touch: np.ndarray) -> np.ndarray:
    """Return the rows from the first stroke to the last: while all fingers touch."""
    rows = touch.copy()
    rows[np.argmax(rows) : len(rows) - np.argmax(rows[::-1])] = rows.any()
    stroke = np.ptp(pads[rows].mean(axis=1), axis=0).max() if rows.any() else 0.0
    if stroke < LEAST_LIFT:
        raise UsageError(f"targets that wipe {1000 * stroke:.0f} mm", "10 mm or more", "replay a demonstrated wipe")
    return rows


def _behind(fingers: np.ndarray, centre: np.ndarray, first: int, wiping: np.ndarray | None) -> np.ndarray:
    """Return the object's distance behind the fingers since a first row [m], shape (n,); 0 before.

    Args:
        fingers: Mean of the pads [m], shape (n, 3).
        centre: The object's centre [m], shape (n, 3).
        first: Row from which it is counted.
        wiping: Rows of the strokes, whose main direction counts; None for a lift, whose height counts.
    """
    distance = centre - centre[first] - (fingers - fingers[first])
    if wiping is None:
        lag = -distance[:, 2]
    else:
        stroke = fingers[wiping] - fingers[wiping].mean(axis=0)
        # Strokes go both ways, so that a lag has either sign.
        lag = np.abs(distance @ np.linalg.svd(stroke, full_matrices=False)[2][0])
    lag[:first] = 0.0
    return lag
