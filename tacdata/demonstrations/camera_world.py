"""A camera's pose in the world, as a file (`schemas/camera_world.schema.json`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.errors import FormatError

UNNAMED = "camera"
"""Name of a camera that nobody named; its file passes for any."""
FARTHEST = 50.0
"""Largest plausible distance from the world's origin [m]; more are millimetres."""
REMEASURED = 0.02
"""Largest difference of a square's side that is one of measuring it [1]."""
WORST = (0.1, "m", "are these millimetres?"), (0.35, "rad", "are these degrees?")
"""Largest plausible standard uncertainty of position and rotation, its unit, and the likely cause of a larger one."""


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
    board: dict[str, Any] | None = None
    """The board that is the world, as in its file; by a board only."""

    def document(self, date: str) -> dict[str, Any]:
        """Return the document for a file; ``date`` is ISO 8601."""
        content: dict[str, Any] = {
            "version": schemas.version("camera_world"),
            "camera": self.camera,
            "frame": self.frame,
            **_flat(self.matrix),
            "method": self.method,
            "poses": self.poses,
            "residual": _errors(self.residual),
        }
        if self.spread is not None:
            content["spread"] = _errors(self.spread)
        if self.cube is not None:
            content["cube"] = _flat(self.cube)
        if self.board is not None:
            content["board"] = self.board
        return {**content, "remarks": list(self.remarks), "date": date, "code_version": provenance.code_version()}

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> CameraWorld:
        """Build it from a parsed file.

        Raises:
            FormatError: If it breaks the schema or a quaternion has no length.
        """
        documents.check(document, "camera_world", origin)
        spread, cube = document.get("spread"), document.get("cube")
        _check_spread(spread, origin)
        return cls(
            document["camera"],
            document["frame"],
            pose_matrix(document, origin),
            document["method"],
            document["poses"],
            (document["residual"]["position"], document["residual"]["rotation"]),
            (spread["position"], spread["rotation"]) if spread else None,
            pose_matrix(cube, f"{origin}: cube") if cube else None,
            tuple(document.get("remarks", ())),
            document.get("board"),
        )


def check_worlds(worlds: dict[str, CameraWorld], origin: str) -> None:
    """Refuse a camera's file that is another camera's, or of another board.

    Args:
        worlds: Camera -> content of its file.
        origin: The rig file, for words.

    Raises:
        FormatError: Naming both.
    """
    for name, world in worlds.items():
        if world.camera not in (name, UNNAMED):
            raise FormatError(
                f"{origin}: the world of camera {name} is a file of camera {world.camera}",
                f"one that was made for camera {name}",
                f"name its own file, or calibrate it by tacdata calibrate-world --camera {name}",
            )
    for (name, world), (rival_name, rival) in combinations(worlds.items(), 2):
        alike = np.allclose(world.matrix, rival.matrix, rtol=0, atol=1e-9)
        # A file with a name passed the check above for one camera only; an unnamed one passes for any.
        if UNNAMED in (world.camera, rival.camera) and alike:
            fault = f"{origin}: cameras {name} and {rival_name} stand in the same place: is one file named twice?"
            raise FormatError(fault, "a place of its own for each camera", "name each camera's own file")
        if world.board and rival.board and not _same_board(world.board, rival.board):
            raise FormatError(
                f"{origin}: cameras {name} and {rival_name} were calibrated on different boards, of "
                f"{_squares(world.board)} and {_squares(rival.board)}",
                "one board for all cameras, which lies still meanwhile",
                "calibrate both again, with the board in one place",
            )


def _same_board(board: dict[str, Any], reference: dict[str, Any]) -> bool:
    """Return whether two files describe one board; its squares may have been measured twice."""
    same = all(board.get(name) == reference.get(name) for name in ("columns", "rows", "dictionary", "legacy"))
    return same and abs(board["square"] - reference["square"]) < REMEASURED * board["square"]


def _squares(board: dict[str, Any]) -> str:
    return f"{board['columns']} x {board['rows']} squares of {board['square']:g} mm"


def pose_matrix(entry: dict[str, Any], origin: str) -> np.ndarray:
    """Return a pose's ``position`` [m] and ``quaternion`` (xyzw) as a homogeneous matrix, shape (4, 4).

    Raises:
        FormatError: If the quaternion is not of length 1, or the position is farther than `FARTHEST`.
    """
    from scipy.spatial.transform import Rotation

    turn = np.array(entry["quaternion"], float)
    if not 0.99 < np.linalg.norm(turn) < 1.01:
        fault = f"{origin}: quaternion {turn.tolist()} of length {np.linalg.norm(turn):.3f}"
        raise FormatError(fault, "xyzw of length 1", "correct it; no rotation is [0, 0, 0, 1]")
    # Negated, so that NaN is refused, too.
    if not (away := float(np.linalg.norm(entry["position"]))) <= FARTHEST:
        fault = f"{origin}: a position {away:g} m away: are these millimetres?"
        raise FormatError(fault, f"metres, up to {FARTHEST:g} m", "give it in metres")
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
    matrix[:3, 3] = entry["position"]
    return matrix


def _check_spread(spread: dict[str, float] | None, origin: str) -> None:
    """Refuse a standard uncertainty that is negative, in millimetres or in degrees."""
    for name, limit, unit, hint in (("position", *WORST[0]), ("rotation", *WORST[1])):
        if spread is not None and not 0 <= spread[name] <= limit:
            fault = f"{origin}: a spread of the {name} of {spread[name]:g} {unit}: {hint}"
            raise FormatError(fault, f"0 to {limit:g} {unit}", f"give it in {unit}, or calibrate the camera again")


def _errors(values: tuple[float, float]) -> dict[str, float]:
    return {"position": float(values[0]), "rotation": float(values[1])}


def _flat(matrix: np.ndarray) -> dict[str, list[float]]:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return {"position": matrix[:3, 3].tolist(), "quaternion": turn.tolist()}
