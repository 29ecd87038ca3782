"""A camera's pose in the world, as a file (`schemas/camera_world.schema.json`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import schemas
from tacdata import documents, provenance
from tacdata.errors import FormatError


@dataclass(frozen=True, eq=False)
class CameraWorld:
    """A camera's pose in the world."""

    camera: str
    frame: str
    """Name of the world's frame."""
    matrix: np.ndarray
    """The camera's frame in the world, homogeneous, shape (4, 4) [m]."""
    method: str
    """Method by which it was found."""
    poses: int
    """Number of poses or images used."""
    residual: tuple[float, float]
    """Root mean square residual of the pairs: position [m], rotation [rad]."""
    spread: tuple[float, float] | None = None
    """Standard uncertainty of the camera's position [m] and rotation [rad], if known."""
    cube: np.ndarray | None = None
    """The cube in the gripper's frame, homogeneous, shape (4, 4) [m]; hand-eye only."""
    remarks: tuple[str, ...] = field(default=())

    def document(self, date: str) -> dict[str, Any]:
        """Return the document for a file; ``date`` is ISO 8601."""
        made: dict[str, Any] = {
            "version": schemas.version("camera_world"), "camera": self.camera, "frame": self.frame,
            **_flat(self.matrix), "method": self.method, "poses": self.poses,
            "residual": _errors(self.residual),
        }  # fmt: skip
        if self.spread is not None:
            made["spread"] = _errors(self.spread)
        if self.cube is not None:
            made["cube"] = _flat(self.cube)
        return {**made, "remarks": list(self.remarks), "date": date, "code_version": provenance.code_version()}

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> CameraWorld:
        """Build it from a parsed file.

        Raises:
            FormatError: If it breaks the schema or a quaternion has no length.
        """
        documents.check(document, "camera_world", origin)
        spread, cube = document.get("spread"), document.get("cube")
        return cls(
            document["camera"], document["frame"], pose_matrix(document, origin), document["method"],
            document["poses"], (document["residual"]["position"], document["residual"]["rotation"]),
            (spread["position"], spread["rotation"]) if spread else None,
            pose_matrix(cube, f"{origin}: cube") if cube else None, tuple(document.get("remarks", ())),
        )  # fmt: skip


def pose_matrix(entry: dict[str, Any], origin: str) -> np.ndarray:
    """Return a pose's ``position`` [m] and ``quaternion`` (xyzw) as a homogeneous matrix, shape (4, 4).

    Raises:
        FormatError: If the quaternion is not of length 1.
    """
    from scipy.spatial.transform import Rotation

    turn = np.array(entry["quaternion"], float)
    if not 0.99 < np.linalg.norm(turn) < 1.01:
        given = f"{origin}: quaternion {turn.tolist()} of length {np.linalg.norm(turn):.3f}"
        raise FormatError(given, "xyzw of length 1", "correct it; no rotation is [0, 0, 0, 1]")
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
    matrix[:3, 3] = entry["position"]
    return matrix


def _errors(values: tuple[float, float]) -> dict[str, float]:
    return {"position": float(values[0]), "rotation": float(values[1])}


def _flat(matrix: np.ndarray) -> dict[str, list[float]]:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return {"position": matrix[:3, 3].tolist(), "quaternion": turn.tolist()}
