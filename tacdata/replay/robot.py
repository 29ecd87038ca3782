"""A robot file (`schemas/robot.schema.json`), and its URDF without shapes and masses."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance
from tacdata.demonstrations.camera_world import pose_matrix
from tacdata.errors import FormatError, UsageError

POSITION_TOLERANCE = 0.0005
"""Default position tolerance of a target [m]."""
ORIENTATION_WEIGHT = 0.02
"""Weight of a rotation error relative to a position error [m/rad]: 1 deg counts as 0.35 mm."""
HAIR = 1e-6
"""Range given to a joint whose limits are equal [rad or m]."""
SHAPES = ("visual", "collision", "inertial", "transmission", "gazebo")
"""Elements of a URDF that kinematics does not need. Meshes are often missing where a trajectory is computed, and many
files hold impossible inertias.
"""


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
    """Tolerance of position [m] and rotation [rad]; None: rotations are not checked."""
    velocity: dict[str, float]
    """Joint -> largest speed [rad/s or m/s]: the robot file's, else the URDF's; joints without limit are missing."""
    acceleration: dict[str, float]
    """Joint -> largest acceleration [rad/s^2 or m/s^2], where the robot file gives one."""
    workspace: tuple[np.ndarray, np.ndarray] | None
    """Lower and upper corner of the box that targets must lie in, root frame [m], shape (3,) each."""
    document: dict[str, Any]


def read_robot(path: Path) -> Robot:
    """Read a robot file and the URDF that it names.

    Raises:
        UsageError: If one of them does not exist.
        FormatError: If one is damaged, a link is not in the URDF, or the workspace is empty.
    """
    document = documents.read(Path(path), "robot")
    urdf = Path(path).parent / document["urdf"]
    if not urdf.is_file():
        raise UsageError(f"{path}: no URDF {urdf}", "a file named relative to the robot file", "correct urdf")
    try:
        root = ET.fromstring(urdf.read_bytes())  # in the encoding that its first line names, or UTF-8
    except (ET.ParseError, LookupError, ValueError) as error:
        raise FormatError(f"{urdf} is no XML: {error}", "a URDF", "export it again from the CAD or xacro") from None
    links = {link.get("name") for link in root.iter("link")}
    joints = {str(joint.get("name")): joint for joint in root.iter("joint") if joint.get("type") is not None}
    if root.tag != "robot" or not links:
        raise FormatError(f"{urdf}: <{root.tag}> with {len(links)} links", "<robot> with links", "give a URDF")
    for what, given, known in (
        ("link", [entry["link"] for entry in document["fingers"].values()], links),
        ("joint", [n for key in ("home", "velocity", "acceleration") for n in document.get(key, {})], set(joints)),
    ):
        unknown = sorted(set(given) - known)
        if unknown:
            raise FormatError(
                f"{path}: {what} {', '.join(unknown)}, not in {urdf.name}", ", ".join(sorted(map(str, known))),
                f"name a {what} of the URDF",
            )  # fmt: skip
    found = {name: joint.find("limit") for name, joint in joints.items()}
    try:
        _locked(root)
        limits = {name: float(limit.get("velocity", "nan")) for name, limit in found.items() if limit is not None}
    except ValueError as error:
        raise FormatError(f"{urdf}: {error}", "numbers as limits", "correct the URDF") from None
    velocity = {n: v for n, v in limits.items() if np.isfinite(v) and v > 0} | document.get("velocity", {})
    tips = {
        name: (entry["link"], pose_matrix({**HERE, **entry}, f"{path}: fingers/{name}"))
        for name, entry in document["fingers"].items()
    }
    allowed = document.get("tolerance", {})
    tolerance = float(allowed.get("position", POSITION_TOLERANCE)), allowed.get("rotation")
    return Robot(
        document["name"], _without_shapes(root), provenance.file_hash(urdf),
        pose_matrix(document.get("base", HERE), f"{path}: base"), tips, document.get("home", {}),
        float(document.get("orientation_weight", ORIENTATION_WEIGHT)), tolerance, velocity,
        document.get("acceleration", {}), _workspace(document, str(path)), document,
    )  # fmt: skip


HERE = {"position": [0.0, 0.0, 0.0], "quaternion": [0.0, 0.0, 0.0, 1.0]}


def _locked(root: ET.Element) -> None:
    """Give joints with equal limits a tiny range: MuJoCo would take them for joints without limits."""
    for joint in root.iter("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        low, high = (float(limit.get(end, "0")) for end in ("lower", "upper"))
        if low == high:
            limit.set("lower", repr(low - HAIR))
            limit.set("upper", repr(high + HAIR))


def _without_shapes(root: ET.Element) -> str:
    for parent in root.iter():
        for child in [child for child in parent if child.tag in SHAPES]:
            parent.remove(child)
    return ET.tostring(root, encoding="unicode")


def _workspace(document: dict[str, Any], origin: str) -> tuple[np.ndarray, np.ndarray] | None:
    box = document.get("workspace")
    if box is None:
        return None
    low, high = np.array(box["min"], float), np.array(box["max"], float)
    if (low >= high).any():
        given = f"{origin}: workspace min {box['min']}, max {box['max']} m"
        raise FormatError(given, "min below max on every axis", "correct the workspace")
    return low, high
