"""A robot file (`schemas/robot.schema.json`): the pose of a robot's base, which links carry fingertips, its limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance
from tacdata.demonstrations.camera_world import pose_matrix
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.replay.robot.urdf import FARTHEST, read_urdf

POSITION_TOLERANCE = 0.0005
"""Default position tolerance of a target [m]."""
ROTATION_TOLERANCE = float(np.radians(2.0))
"""Default rotation tolerance of a target [rad]: at a pad's rim, 8 mm away, it is 0.3 mm."""
ORIENTATION_WEIGHT = 0.02
"""Weight of a rotation error relative to a position error [m/rad]: 1 deg counts as 0.35 mm."""

NAMED = ("home", "velocity", "acceleration", "stiffness")
"""Entries of a robot file that name joints."""
LONGEST = 1.0
"""Largest plausible distance of a fingertip from its link [m]."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot: its URDF, fingertips and limits."""

    name: str
    urdf: str
    """The URDF's text."""
    urdf_hash: str
    """SHA-256 of the URDF's file."""
    base: np.ndarray
    """The URDF's root in the demonstration's frame, shape (4, 4) [m]."""
    tips: dict[str, tuple[str, np.ndarray]]
    """Finger -> link, and the fingertip's frame in it, shape (4, 4) [m]."""
    home: dict[str, float]
    """Joint -> start of the search [rad or m]."""
    orientation_weight: float
    """Weight of a rotation error relative to a position error [m/rad]."""
    tolerance: tuple[float, float | None]
    """Tolerance of position [m] and rotation [rad]; None, where rotations weigh nothing: they are not checked."""
    velocity: dict[str, float]
    """Joint -> largest speed [rad/s or m/s]: the robot file's, else the URDF's; joints without limit are missing."""
    acceleration: dict[str, float]
    """Joint -> largest acceleration [rad/s^2 or m/s^2], where the robot file gives one."""
    workspace: tuple[np.ndarray, np.ndarray] | None
    """Lower and upper corner of the box that targets must lie in, root frame [m], shape (3,) each."""
    document: dict[str, Any]
    remarks: tuple[str, ...] = ()
    """Remarks about the URDF's limits."""
    stiffness: dict[str, float] = field(default_factory=dict)
    """Joint -> stiffness with which its controller holds it [N m/rad or N/m], where the robot file gives one."""
    pads: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Finger -> half axes of its pad along the fingertip's x, y and z [m], where the robot file gives them."""
    source: Path | None = None
    """The URDF's file, with its shapes."""


def read_robot(path: StrPath) -> Robot:
    """Read a robot file and the URDF that it names.

    Raises:
        UsageError: If one of them does not exist.
        FormatError: If one is damaged, a link is not in the URDF, or the workspace is empty.
    """
    document = documents.read(Path(path), "robot")
    origin = Path(path).parent / document["urdf"]
    urdf = read_urdf(origin)
    for what, entries, members in (
        ("link", [entry["link"] for entry in document["fingers"].values()], urdf.links),
        ("joint", [n for key in NAMED for n in document.get(key, {})], urdf.joints),
    ):
        unknown = sorted(set(entries) - set(members))
        if unknown:
            raise FormatError(
                f"{path}: {what} {', '.join(unknown)}, not in {origin.name}",
                ", ".join(sorted(members)),
                f"name a {what} of the URDF",
            )
    velocity = urdf.velocity | document.get("velocity", {})
    tips = {
        name: (entry["link"], _pose({**HERE, **entry}, f"{path}: fingers/{name}", LONGEST))
        for name, entry in document["fingers"].items()
    }
    allowed = document.get("tolerance", {})
    weight = float(document.get("orientation_weight", ORIENTATION_WEIGHT))
    rotation = allowed.get("rotation", ROTATION_TOLERANCE if weight > 0 else None)
    tolerance = float(allowed.get("position", POSITION_TOLERANCE)), rotation
    return Robot(
        document["name"],
        urdf.text,
        provenance.file_hash(origin),
        _pose(document.get("base", HERE), f"{path}: base", FARTHEST),
        tips,
        document.get("home", {}),
        weight,
        tolerance,
        velocity,
        document.get("acceleration", {}),
        _workspace(document, str(path)),
        document,
        urdf.remarks,
        document.get("stiffness", {}),
        {name: tuple(entry["pad"]) for name, entry in document["fingers"].items() if "pad" in entry},
        origin,
    )


HERE = {"position": [0.0, 0.0, 0.0], "quaternion": [0.0, 0.0, 0.0, 1.0]}


def _pose(entry: dict[str, Any], origin: str, farthest: float) -> np.ndarray:
    """Return a pose, shape (4, 4) [m]; refuse a position in millimetres."""
    away = float(np.linalg.norm(entry["position"]))
    if away > farthest:
        raise FormatError(
            f"{origin}: a position {away:g} m away: are these millimetres?",
            f"metres, up to {farthest:g} m",
            "give it in metres",
        )
    return pose_matrix(entry, origin)


def _workspace(document: dict[str, Any], origin: str) -> tuple[np.ndarray, np.ndarray] | None:
    box = document.get("workspace")
    if box is None:
        return None
    low, high = np.array(box["min"], float), np.array(box["max"], float)
    if (low >= high).any():
        fault = f"{origin}: workspace min {box['min']}, max {box['max']} m"
        raise FormatError(fault, "min below max on every axis", "correct the workspace")
    return low, high
