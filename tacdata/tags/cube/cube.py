"""A cube with AprilTags on its faces.

Cube frame: origin at the cube's centre, axes along its edges, right-handed. A tag is centred on its face and is
upright as OpenCV draws it (`cv2.aruco.generateImageMarker`). On the side faces its upper edge points to the cube's +z,
on the +z face to +y. The images published by AprilRobotics are turned by 180 degrees.

Corner order is the AprilTag library's. In that upright view from outside: right-top, left-top, left-bottom,
right-bottom (counter-clockwise). OpenCV's ArUco detector gives left-top, right-top, right-bottom, left-bottom.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tacdata.errors import FormatError

NORMALS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1)}
"""Outward normals of the five faces that may carry a tag; -z is where the cube is mounted."""
_UPS = {face: (0, 1, 0) if face == "+z" else (0, 0, 1) for face in NORMALS}
AXES = {
    face: np.stack([np.cross(_UPS[face], normal), _UPS[face], normal], axis=-1).astype(float)
    for face, normal in NORMALS.items()
}
"""A face's right, up and outward directions in the cube frame as columns, shape (3, 3)."""

SIDES = 2.0, 1000.0
"""Smallest and largest plausible side of a cube [mm]."""
CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
"""Right and up of a tag's corners in half tags [1], in the AprilTag library's order."""


@dataclass(frozen=True)
class Cube:
    """A cube's measures and tags.

    Example:
        >>> from tacdata.tags import Cube
        >>> document = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+z": 4}}
        >>> cube = Cube.from_document(document, "my cube")
        >>> cube.faces
        {0: '+x', 1: '-x', 4: '+z'}
        >>> cube.corners("+z")[0]  # right-top corner of the tag, m
        array([0.008, 0.008, 0.01 ])
    """

    side: float
    """Edge of the cube [mm]."""
    tag: float
    """Edge of a tag's black square [mm]."""
    ids: dict[str, int]
    """Face ("+x", "-x", "+y", "-y", "+z") to tag number."""

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str = "cube") -> Cube:
        """Build a cube from a rig file's ``cube`` entry.

        Raises:
            FormatError: If a measure is missing or impossible, or two faces carry the same tag.
        """
        missing = {"side", "tag", "ids"} - set(document)
        if missing:
            fault = f"{origin}: no {', '.join(sorted(missing))}"
            raise FormatError(fault, "side, tag [mm] and ids", "add it")
        side, tag, ids = document["side"], document["tag"], document["ids"]
        if not 0 < tag <= side:
            fault = f"{origin}: tag {tag} mm on a side of {side} mm"
            raise FormatError(fault, "0 < tag <= side", "measure the black square")
        if not SIDES[0] <= side <= SIDES[1]:
            fault = f"{origin}: a side of {side} mm: is it in another unit?"
            raise FormatError(fault, f"{SIDES[0]:g} to {SIDES[1]:g} mm", "give side and tag in millimetres")
        unknown = sorted(set(ids) - set(NORMALS))
        if unknown or not ids:
            fault = f"{origin}: ids for {', '.join(unknown) or 'no face'}"
            raise FormatError(fault, ", ".join(NORMALS), "correct ids")
        # Family 36h11 has 587 tags.
        if len(set(ids.values())) < len(ids) or not all(0 <= i <= 586 for i in ids.values()):
            raise FormatError(f"{origin}: ids {ids}", "different numbers from 0 to 586", "correct ids")
        return cls(float(side), float(tag), dict(ids))

    @cached_property
    def faces(self) -> dict[int, str]:
        """Tag number to face."""
        return {tag: face for face, tag in self.ids.items()}

    def points(self, face: str, places: np.ndarray) -> np.ndarray:
        """Return points of a face in the cube frame [m].

        Args:
            face: Which face.
            places: Right and up from the tag's centre in half tags [1], shape (n, 2); the black square's
                corners lie at +-1.
        """
        half = self.tag / 2000
        flat = np.column_stack([half * np.asarray(places), np.full(len(places), self.side / 2000)])
        return flat @ AXES[face].T

    @cached_property
    def _corners(self) -> dict[str, np.ndarray]:
        return {face: self.points(face, CORNERS) for face in self.ids}

    def corners(self, face: str) -> np.ndarray:
        """Return a tag's corners in the cube frame [m], shape (4, 3), in the AprilTag library's order."""
        return self._corners[face]
