"""The skin's stress-free geometry as data, with formulas that follow from it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from tacdata.errors import FormatError
from tacdata.sensor import own_surface
from tacdata.sensor.own_surface import OwnSurface

_OPTIONAL = {"protrusion_height": None, "curvature_radius_x": 0.0, "curvature_radius_y": 0.0, "underside": "bent"}
"""Optional fields, left out of a document at their default, so that files and hashes of format 1.0 stay valid."""

_LEAST = 0.2
"""Minimum thickness at the rim of a curved pad with a flat underside, over `thickness` [1]."""


@dataclass(frozen=True)
class Skin:
    """Stress-free geometry: a slab from z = 0 to z = thickness, with protrusions below z = 0 under the taxels.

    A curved pad is that slab bent, its outer face convex; in plan the outer face keeps its rectangle.
    """

    size_x: float
    """Footprint along x [mm]."""
    size_y: float
    """Footprint along y [mm]."""
    thickness: float
    """Slab thickness at the centre [mm]; the outer face is z = thickness there."""
    protrusion_radius: float = 0.0
    """Radius of a protrusion's foot [mm]; 0 for a plain slab."""
    protrusion_height: float | None = None
    """How far protrusions reach below z = 0 [mm]; None: the radius (hemispheres). Lower ones are spherical caps,
    higher ones cylinders with a hemispherical end."""
    curvature_radius_x: float = 0.0
    """Radius of the outer face in the xz plane [mm]; 0 for straight."""
    curvature_radius_y: float = 0.0
    """Radius of the outer face in the yz plane [mm]; 0 for straight. Two equal radii make a sphere's cap."""
    underside: str = "bent"
    """Of a curved pad: "bent" (constant thickness along the normal) or "flat" (z = 0, thinner towards the rim)."""
    surface: OwnSurface | None = None
    """The skin's own surface from a file; the sizes above then state its box. None: as above."""

    @property
    def protrusion_tip(self) -> float:
        """Depth of the protrusions' tips below z = 0 [mm]; a board touches them at z = -protrusion_tip."""
        return self.protrusion_radius if self.protrusion_height is None else self.protrusion_height

    @property
    def curved(self) -> bool:
        """Whether the outer face is curved."""
        return bool(self.curvature_radius_x or self.curvature_radius_y)

    @property
    def document(self) -> dict[str, Any]:
        """The skin as its part of the sensor's document."""
        values = {k: v for k, v in asdict(self).items() if k not in _OPTIONAL or v != _OPTIONAL[k]}
        del values["surface"]
        return values if self.surface is None else {**values, "surface": self.surface.document}

    @property
    def identity(self) -> dict[str, Any]:
        """The part of the document that decides a mesh or a label; of a surface file its content, not its name."""
        values = self.document
        if self.surface is not None:
            values["surface"] = {k: v for k, v in values["surface"].items() if k != "file"}
        return values

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str, folder: Path | None) -> Self:
        """Build a skin from its part of the sensor's document.

        Args:
            document: That part.
            origin: Names the file in errors.
            folder: Folder that the name of a surface file is relative to; None if the document is in no file.

        Raises:
            UsageError: If a surface file is not found.
            FormatError: If it bounds no solid, or not one of the sizes stated.
        """
        if "surface" not in document:
            return cls(**document)
        document = own_surface.complete(document, origin, folder)
        return cls(**{**document, "surface": OwnSurface.from_document(document["surface"])})  # ty: ignore[invalid-argument-type]

    def outer_height(self, x: np.ndarray | float, y: np.ndarray | float) -> np.ndarray:
        """Return the height z of the undeformed outer face [mm] at (x, y) [mm], of the arguments' shape."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        rx, ry = self.curvature_radius_x, self.curvature_radius_y
        if rx and ry:
            return self.thickness - ry + np.sqrt(self._tube(x) ** 2 - y**2)
        lateral, radius = (x, rx) if rx else (y, ry)
        if not radius:
            return np.full(np.broadcast(x, y).shape, self.thickness)
        # The zero gives the result the shape of both arguments.
        return self.thickness - radius + np.sqrt(radius**2 - lateral**2) + 0 * (x + y)

    def outer_normal(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the unit normal of the undeformed outer face [1], shape (n, 3), at (x, y) [mm], each (n,)."""
        rx, ry = self.curvature_radius_x, self.curvature_radius_y
        if rx and ry:
            # The arc in the yz plane is swept along the one in the xz plane, so its radius changes with x.
            sine = y / self._tube(x)
            up = np.sqrt(rx**2 - x**2)
            return np.stack([x, up * sine, up * np.sqrt(1 - sine**2)], axis=-1) / rx
        if rx:
            return np.stack([x, 0 * x, np.sqrt(rx**2 - x**2)], axis=-1) / rx
        if ry:
            return np.stack([0 * y, y, np.sqrt(ry**2 - y**2)], axis=-1) / ry
        return np.broadcast_to([0.0, 0.0, 1.0], (*np.shape(x), 3)).copy()

    def _tube(self, x: np.ndarray) -> np.ndarray:
        """Distance of the outer face from the axis along x about which its arc in the xz plane is swept [mm]."""
        return self.curvature_radius_y - self.curvature_radius_x + np.sqrt(self.curvature_radius_x**2 - x**2)

    def check(self, origin: str, board: bool) -> None:
        """Refuse geometry that contradicts itself; ``origin`` names the file.

        Raises:
            FormatError: Naming the field.
        """
        if self.protrusion_height is not None and not self.protrusion_radius:
            raise FormatError(
                f"{origin}: skin/protrusion_height {self.protrusion_height:g} mm with protrusion_radius 0 mm",
                "a height only with a positive protrusion_radius",
                "set skin/protrusion_radius or remove the height",
            )
        if not self.curved:
            return
        if self.surface is not None:
            raise FormatError(
                f"{origin}: skin/surface and a curvature radius",
                "one of them",
                "remove skin/curvature_radius_x and _y: the surface in the file is taken as it is",
            )
        if board and self.underside != "flat":
            raise FormatError(
                f"{origin}: a flat board under a bent underside touches no more than its lowest protrusions",
                "underside: flat with a board, or board: false",
                "set skin/underside: flat or contact/board: false",
            )
        self._check_bend(origin)

    def _check_bend(self, origin: str) -> None:
        rx, ry = self.curvature_radius_x, self.curvature_radius_y
        for axis, radius, half in (("x", rx, self.size_x / 2), ("y", ry, self.size_y / 2)):
            # A flat underside is not bent, however thick the skin is.
            deepest = self.thickness + self.protrusion_tip if self.underside == "bent" else 0.0
            # At half the width the rim would stand upright; at the depth the bent underside would fold.
            limit = max(1.05 * half, 1.25 * deepest)
            if radius and radius < limit:
                raise FormatError(
                    f"{origin}: skin/curvature_radius_{axis} {radius:g} mm, the skin is {2 * half:g} mm wide and "
                    f"{self.thickness:g} mm thick",
                    f"at least {limit:g} mm, or 0 for straight",
                    f"enlarge skin/curvature_radius_{axis}, or make the skin narrower or thinner",
                )
        hx, hy = self.size_x / 2, self.size_y / 2
        if rx and ry and float(self._tube(np.array(hx))) <= 1.05 * hy:
            raise FormatError(
                f"{origin}: radii {rx:g} and {ry:g} mm leave no outer face over the corners of {self.size_x:g} x "
                f"{self.size_y:g} mm",
                "larger radii or a smaller skin",
                "enlarge skin/curvature_radius_x and _y",
            )
        edge_height = float(self.outer_height(hx, hy))
        if self.underside == "flat" and edge_height < _LEAST * self.thickness:
            raise FormatError(
                f"{origin}: the outer face falls to z = {edge_height:.2f} mm at the skin's corners, "
                "the underside is flat",
                f"at least {_LEAST * self.thickness:g} mm left",
                "enlarge the radii or the thickness",
            )
