"""The cube of each finger, and the fingertip's place on it (`schemas/fingers.schema.json`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.paths import StrPath
from tacdata.tags.cube.cube import Cube

FARTHEST = 0.5
"""Largest plausible distance of a fingertip from its cube's centre [m]."""


@dataclass(frozen=True, eq=False)
class Finger:
    """A finger with its cube.

    The fingertip's frame: origin on the pad, x along the finger to its end, z out of the pad towards the object
    touched, right-handed.
    """

    name: str
    """Its name in the file."""
    cube: Cube
    tip: np.ndarray
    """The fingertip's frame in the cube's, homogeneous, shape (4, 4) [m]."""
    tip_spread: float = 0.0
    """Standard deviation of the fingertip's position on the cube [m]."""
    hand: str = ""
    """"left", "right" or unknown."""
    kind: str = ""
    """"thumb", "index", "middle", "ring", "little" or unknown."""


def fingers_of(document: dict[str, Any], origin: str = "fingers") -> dict[str, Finger]:
    """Return the fingers of a parsed file by name; ``origin`` names it in errors.

    Raises:
        FormatError: If the document breaks the schema, a cube is impossible, a quaternion has no length or
            two cubes carry the same tag.
    """
    documents.check(document, "fingers", origin)
    fingers = {name: _finger(name, entry, origin) for name, entry in document["fingers"].items()}
    owners: dict[int, str] = {}
    for name, finger in fingers.items():
        for face, tag in finger.cube.ids.items():
            if tag in owners:
                raise FormatError(
                    f"{origin}: tag {tag} is on {owners[tag]} and on {name} {face}",
                    "every tag on one face only",
                    "read the numbers off the cubes and correct ids",
                )
            owners[tag] = f"{name} {face}"
    return fingers


def read_fingers(path: StrPath) -> dict[str, Finger]:
    """Read a fingers file.

    Raises:
        UsageError: If it does not exist.
        FormatError: As `fingers_of`.
    """
    return fingers_of(documents.read(Path(path), "fingers"), str(path))


def _check_tip(place: np.ndarray, cube: Cube, origin: str) -> None:
    """Refuse a fingertip within its cube, as metres would place it, or far away from it."""
    fault = f"{origin}: a fingertip at {[round(1000 * float(value), 3) for value in place]} mm"
    if 0 < np.abs(place).max() < cube.side / 2000:
        where, remedy = f"is inside the cube of {cube.side:g} mm", "give tip/position in mm, from the cube's centre"
        raise FormatError(f"{fault} {where}: is it in metres?", "a place outside of the cube", remedy)
    # Negated, so that NaN is refused, too.
    if not np.linalg.norm(place) <= FARTHEST:
        where, remedy = "is away from its cube", "give tip/position in mm, from the cube's centre"
        raise FormatError(f"{fault} {where}: is it in micrometres?", f"up to {1000 * FARTHEST:g} mm", remedy)


def _finger(name: str, entry: dict[str, Any], origin: str) -> Finger:
    from scipy.spatial.transform import Rotation

    tip, turn = np.eye(4), np.array(entry["tip"]["quaternion"], float)
    if not 0.99 < np.linalg.norm(turn) < 1.01:
        raise FormatError(
            f"{origin}: {name}: tip quaternion {turn.tolist()} of length {np.linalg.norm(turn):.3f}",
            "xyzw of length 1",
            "correct it; no rotation is [0, 0, 0, 1]",
        )
    tip[:3, :3] = Rotation.from_quat(turn).as_matrix()
    tip[:3, 3] = np.array(entry["tip"]["position"], float) / 1000
    spread = float(entry["tip"].get("residual", 0.0)) / 1000
    cube = Cube.from_document(entry["cube"], f"{origin}: {name}: cube")
    _check_tip(tip[:3, 3], cube, f"{origin}: {name}")
    kind = entry.get("finger") or next((k for k in ("thumb", "index", "middle") if k in name), "")
    return Finger(name, cube, tip, spread, entry.get("hand", ""), kind)
