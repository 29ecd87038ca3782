"""A rigid solid from a surface file: checked surface, lowest point at z = 0, distance on each device."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tacdata import provenance
from tacdata.paths import cache_folder
from tacdata.surfaces.closed import read_closed

if TYPE_CHECKING:
    import trimesh

    from tacdata.surfaces.distance_grid import DistanceGrid

TOP = 6.0
"""Height above which a solid continues as a column, for its distance [mm]; no skin is pressed that deep."""

_RECIPE = 1
"""Version of the distance fit; raise it if `tacdata.surfaces` would compute another distance for the same file."""


@dataclass(frozen=True)
class Solid:
    """A rigid solid that presses with its lowest point."""

    mesh: trimesh.Trimesh
    """Its surface as tessellated [mm], lowest point at z = 0."""
    key: str
    """Name under which its distance is stored."""

    @cached_property
    def grid(self) -> DistanceGrid:
        """Its signed distance; fitted once in seconds and kept in the user's cache."""
        from tacdata.surfaces.distance_grid import DistanceGrid, distance_grid

        path = cache_folder() / "shapes" / f"{self.key}.npz"
        if path.is_file():
            with np.load(path) as arrays:
                return DistanceGrid(arrays["coefficients"], arrays["origin"], float(arrays["spacing"]))
        grid = distance_grid(np.asarray(self.mesh.vertices, dtype=float), np.asarray(self.mesh.faces), TOP)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.npz")
        np.savez(temporary, coefficients=grid.coefficients, origin=grid.origin, spacing=grid.spacing)
        temporary.replace(path)
        return grid

    @cached_property
    def _on_devices(self) -> dict[str, tuple[Any, Any]]:
        return {}

    def handle(self, device: str) -> tuple[float, float]:
        """Return the address of the distance on a device, in two numbers that single precision holds.

        It leads to eight float64: address of the coefficients, origin x, y, z and spacing [mm], nodes along x, y, z.
        The data live as long as the process: kernels hold only the address.
        """
        from tacdata.warp_runtime import wp

        if device not in self._on_devices:
            grid = self.grid
            coefficients = wp.array(grid.coefficients, dtype=wp.float32, device=device)
            header = np.array([float(coefficients.ptr or 0), *grid.origin, grid.spacing, *grid.coefficients.shape])
            self._on_devices[device] = (coefficients, wp.array(header, dtype=wp.float64, device=device))
        address = int(self._on_devices[device][1].ptr or 0)
        return float(address >> 24), float(address & 0xFFFFFF)


@cache
def solid(path: Path, scale: float) -> Solid:
    """Return the solid in a surface file, the same object at every call.

    Args:
        path: The file.
        scale: Millimetres in its unit.

    Raises:
        UsageError: If it cannot be read.
        FormatError: If it bounds no solid.
    """
    mesh = read_closed(path, scale, "indenter")
    mesh.apply_translation([0.0, 0.0, -float(mesh.bounds[0, 2])])
    key = provenance.content_hash({"file": provenance.file_hash(path), "scale": scale, "recipe": _RECIPE, "top": TOP})
    return Solid(mesh, key[:32])
