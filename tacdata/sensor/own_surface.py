"""A skin's own surface from a file, with rules that sort its faces into parts."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np

from tacdata.errors import FormatError
from tacdata.surfaces import store
from tacdata.surfaces.closed import read_closed

PARTS = ("protrusions", "outer", "bottom", "sides")
"""Parts of the surface; a face belongs to the first that selects it."""

_FIT = 0.02
"""Largest difference between the surface's box and the sizes in the file [1]."""


@dataclass(frozen=True)
class Selector:
    """A rule that selects faces: all given conditions must hold."""

    normal: tuple[float, float, float] | None = None
    """Outward direction of the faces; of any length."""
    angle: float = 45.0
    """Largest angle between that direction and the face's normal [deg]."""
    low: tuple[float, float, float] | None = None
    """Corner of a box that contains the face's centre [mm]."""
    high: tuple[float, float, float] | None = None
    """The opposite corner [mm]."""

    def chosen(self, centers: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return which faces are selected, shape (f,), from their centres [mm] and unit normals, both (f, 3)."""
        mask = np.ones(len(centers), dtype=bool)
        if self.normal is not None:
            direction = np.array(self.normal) / np.linalg.norm(self.normal)
            # A face at exactly that angle counts, whatever the rounding.
            mask &= normals @ direction >= np.cos(np.radians(self.angle)) - 1e-9
        if self.low is not None:
            mask &= (centers >= self.low).all(axis=1)
        if self.high is not None:
            mask &= (centers <= self.high).all(axis=1)
        return mask


# Beyond any skin, and just off the plane z = 0, on which undersides lie [mm].
_FAR, _ON = 1e6, 1e-3
USUAL: dict[str, tuple[Selector, ...]] = {
    "protrusions": (Selector(high=(_FAR, _FAR, -_ON)),),
    "outer": (Selector(normal=(0.0, 0.0, 1.0), angle=60.0, low=(-_FAR, -_FAR, _ON)),),
    "bottom": (Selector(normal=(0.0, 0.0, -1.0), angle=45.0),),
    "sides": tuple(Selector(normal=n, angle=60.0) for n in ((1.0, 0, 0), (-1.0, 0, 0), (0, 1.0, 0), (0, -1.0, 0))),
}
"""Default rules of parts: protrusions lie below z = 0, the outer face points up."""


@dataclass(frozen=True)
class OwnSurface:
    """A closed surface in the sensor's frame, and rules for its parts."""

    file: str
    """Name of the STL, OBJ or PLY file, in the folder of the sensor file."""
    sha256: str
    """SHA-256 of the file (hex); computed if a sensor file leaves it out."""
    scale: float = 1.0
    """Millimetres in the file's unit [mm]."""
    rules: dict[str, tuple[Selector, ...]] = field(default_factory=dict)
    """Selectors of those of `PARTS` that the file names; a face needs one of them."""

    @property
    def document(self) -> dict[str, Any]:
        """The surface as its part of the sensor's document."""
        rules = {part: [_plain(rule) for rule in rules] for part, rules in self.rules.items()}
        return {"file": self.file, "sha256": self.sha256, "scale": self.scale, **rules}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """Build a surface from `document`, complete with its hash."""
        rules = {part: tuple(_selector(rule) for rule in document[part]) for part in PARTS if part in document}
        return cls(document["file"], document["sha256"], float(document.get("scale", 1.0)), rules)

    def parts(self, centers: np.ndarray, normals: np.ndarray, protrusions: bool) -> np.ndarray:
        """Return each face's part as its number in `PARTS`, or -1, shape (f,).

        Args:
            centers: Faces' centres [mm], shape (f, 3).
            normals: Their unit normals, shape (f, 3).
            protrusions: Whether the skin has any.
        """
        part = np.full(len(centers), -1)
        for number, name in enumerate(PARTS):
            if name == "protrusions" and not protrusions:
                continue
            rules = self.rules.get(name, USUAL[name])
            mask = np.any([rule.chosen(centers, normals) for rule in rules], axis=0)
            # The first part that selects a face keeps it.
            part[mask & (part < 0)] = number
        return part


def complete(document: dict[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
    """Return a skin's document with its surface found, checked against the stated sizes, stored, and named by hash.

    Raises:
        UsageError: If the file is not found.
        FormatError: If it bounds no solid, has other sizes than stated, or another hash than given.
    """
    entry = document["surface"]
    path = (folder or Path()) / entry["file"]
    # A document in a recording names its surface by content; the store has it.
    if "sha256" in entry and not (folder and path.is_file()):
        return document
    mesh = read_closed(path, float(entry.get("scale", 1.0)), f"{origin}: skin")
    digest = store.keep(path)
    if entry.get("sha256", digest) != digest:
        raise FormatError(
            f"{origin}: skin surface {entry['file']} is not the file that is named: SHA-256 {digest[:12]}",
            "the file that was named",
            "restore it, or remove skin/surface/sha256",
        )
    _check_sizes(np.asarray(mesh.bounds), document, origin)
    return {**document, "surface": {**entry, "file": path.name, "sha256": digest}}


def _check_sizes(bounds: np.ndarray, document: dict[str, Any], origin: str) -> None:
    tip = document.get("protrusion_height", document.get("protrusion_radius", 0.0))
    x, y, top = document["size_x"], document["size_y"], document["thickness"]
    stated = np.array([[-x / 2, -y / 2, -tip], [x / 2, y / 2, top]])
    if np.abs(bounds - stated).max() <= _FIT * np.ptp(stated, axis=0).max():
        return
    # A file in another unit is off by the same ratio along each axis: metres, inches, centimetres.
    ratio = float(np.median(np.ptp(stated, axis=0) / np.maximum(np.ptp(bounds, axis=0), 1e-12)))
    unit = next((f for f in (1000.0, 25.4, 10.0, 0.1, 1 / 25.4, 0.001) if abs(ratio / f - 1) < 0.05), None)
    spans = [" to ".join(f"{v:.4g}" for v in column) for column in bounds.T]
    sizes = [" to ".join(f"{v:.4g}" for v in column) for column in stated.T]
    raise FormatError(
        f"{origin}: skin surface {document['surface']['file']} spans x {spans[0]}, y {spans[1]}, z {spans[2]} mm",
        f"as size_x, size_y, thickness and protrusions say: x {sizes[0]}, y {sizes[1]}, z {sizes[2]} mm",
        f"set skin/surface/scale: {unit * float(document['surface'].get('scale', 1.0)):g}"
        if unit
        else "move the surface to the sensor's frame (z = 0 under the slab), or correct the sizes",
    )


def _selector(rule: dict[str, Any]) -> Selector:
    points: dict[str, Any] = {k: tuple(v) for k, v in rule.items() if k != "angle"}
    return Selector(angle=float(rule.get("angle", 45.0)), **points)


def _plain(rule: Selector) -> dict[str, Any]:
    return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(rule).items() if v is not None}
