"""Whether a robot's links touch each other on a joint path, by the collision shapes of its URDF and MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tacdata.replay.engine import mujoco

DEEP = 0.0005
"""Overlap of two shapes from which they collide [m]: shapes are often drawn a little too large."""


@dataclass(frozen=True)
class SelfCollisions:
    """Links that touch each other."""

    pairs: dict[tuple[str, str], tuple[int, ...]]
    """Two links -> rows in which they overlap."""
    reason: str = ""
    """Why nothing was checked; empty if it was."""


def self_collisions(urdf: Path, joints: tuple[str, ...], values: np.ndarray, home: np.ndarray) -> SelfCollisions:
    """Return which links overlap on a joint path. Neighbours, and links that overlap at home, do not count.

    Args:
        urdf: The URDF, with its shapes; meshes are searched in its folder.
        joints: Names of the joints.
        values: Their values [rad or m], shape (n, joints); rows with NaN are passed over.
        home: Their values at home, shape (joints,).
    """
    engine = mujoco()
    try:
        spec = engine.MjSpec.from_file(str(urdf))
        spec.compiler.discardvisual = True
        spec.compiler.fusestatic = False
        spec.compiler.boundmass, spec.compiler.boundinertia = 1e-3, 1e-6
        model = spec.compile()
    except (ValueError, RuntimeError, OSError) as error:
        return SelfCollisions({}, str(error).strip().splitlines()[0])
    shapes = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    if len(shapes) < 2:
        return SelfCollisions({}, "it holds fewer than two collision shapes")
    data = engine.MjData(model)
    places = [int(model.joint(name).qposadr[0]) for name in joints]

    def touching(row: np.ndarray) -> set[tuple[str, str]]:
        data.qpos[places] = row
        engine.mj_kinematics(model, data)
        engine.mj_comPos(model, data)
        engine.mj_collision(model, data)
        contact_pairs = set()
        for contact in data.contact[: data.ncon]:
            bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
            # MuJoCo leaves out neighbours, but not those of a fixed link.
            joined = any(int(model.body_parentid[a]) == b for a, b in (bodies, bodies[::-1]))
            if contact.dist < -DEEP and not joined:
                first, second = sorted(model.body(body).name for body in bodies)
                contact_pairs.add((first, second))
        return contact_pairs

    always = touching(home)
    pairs: dict[tuple[str, str], list[int]] = {}
    for row in np.flatnonzero(np.isfinite(values).all(axis=1)):
        for pair in touching(values[row]) - always:
            pairs.setdefault(pair, []).append(int(row))
    return SelfCollisions({pair: tuple(rows) for pair, rows in pairs.items()})
