"""The skin's mesh: quadratic tetrahedra and the named parts of their surface."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from tacdata.errors import SolveError
from tacdata.skin.mesh import elements

_FLAT = 1e-6
"""Jacobian determinant over the cube of the element's size at which it counts as without volume [1]."""


@dataclass(frozen=True)
class SkinMesh:
    """Mesh of the stress-free skin in the sensor's frame; quadratic tetrahedra with named faces.

    Corner nodes come first in every element (`tacdata.skin.mesh.elements`).

    >>> from tacdata.sensor import default_sensor
    >>> from tacdata.skin.mesh.build import MeshSettings, build_mesh
    >>> mesh = build_mesh(default_sensor(), MeshSettings())  # ships with the package
    >>> mesh.nodes.shape, mesh.tets.shape
    ((10196, 3), (5561, 10))
    >>> bool((mesh.volumes() > 0).all())
    True
    """

    nodes: np.ndarray
    """Node positions [mm], shape (n, 3)."""
    tets: np.ndarray
    """Nodes of each tetrahedron, shape (e, 10), int32."""
    outer: np.ndarray
    """Triangles of the outer face, normals outward, shape (f, 6), int32."""
    protrusions: np.ndarray
    """Triangles of the protrusions' surfaces, normals outward, shape (p, 6), int32."""
    protrusion_taxel: np.ndarray
    """Taxel to which each protrusion triangle belongs, shape (p,), int32."""
    sides: np.ndarray
    """True for nodes on the four side faces, shape (n,), bool."""
    bottom: np.ndarray
    """True for nodes on the plane z = 0 between the protrusions, shape (n,), bool."""

    @property
    def content_hash(self) -> str:
        """SHA-256 of every array (hex)."""
        digest = hashlib.sha256()
        for field in fields(self):
            array = np.ascontiguousarray(getattr(self, field.name))
            digest.update(f"{field.name}{array.dtype}{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()

    def fixed(self, bonded: tuple[str, ...], rim_width: float = 1.0) -> np.ndarray:
        """Return which nodes are held, shape (n,), bool.

        Args:
            bonded: Among "sides", "bottom" and "rim".
            rim_width: Width of the underside's border that "rim" holds [mm].

        Raises:
            SolveError: If none is.
        """
        held = np.zeros(len(self.nodes), dtype=bool)
        for face in bonded:
            held |= self.rim(rim_width) if face == "rim" else getattr(self, face)
        if not held.any():
            raise SolveError(
                "no bonded face holds the skin", "sides or bottom bonded", "set contact/bonded in the sensor file"
            )
        return held

    def rim(self, width: float) -> np.ndarray:
        """Return True for nodes of the underside within ``width`` [mm] of its border with the sides, shape (n,)."""
        from scipy.spatial import KDTree  # here: few skins have a rim, and every start would wait for it

        border = self.nodes[self.sides & self.bottom]
        bonded = self.bottom.copy()
        if len(border):
            bonded[self.bottom] = KDTree(border).query(self.nodes[self.bottom])[0] <= width
        return bonded & self.bottom

    def volumes(self) -> np.ndarray:
        """Return the volume of each element by its straight-sided corners [mm^3], shape (e,)."""
        a, b, c, d = (self.nodes[self.tets[:, k]] for k in range(4))
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6

    def shape_gradients(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the shape gradients and quadrature weights of every element.

        Returns:
            dN/dX [1/mm], shape (e, 4, 10, 3), and weights times Jacobian determinant [mm^3], shape (e, 4).

        Raises:
            SolveError: If an element is flat or turned inside out, with its place.
        """
        points, weights = elements.tetrahedron_quadrature()
        slopes = elements.tetrahedron_gradients(points)
        jacobian = np.einsum("eai,qaj->eqij", self.nodes[self.tets], slopes)
        determinant = np.linalg.det(jacobian)
        # Flat is flat also where rounding leaves a volume of 1e-17.
        size = np.ptp(self.nodes[self.tets[:, :4]], axis=1).max(axis=1) ** 3
        relative = determinant.min(axis=1) / size
        if relative.min() <= _FLAT:
            worst = int(relative.argmin())
            place = self.nodes[self.tets[worst, :4]].mean(axis=0).round(2).tolist()
            raise SolveError(
                f"element {worst} at {place} mm has a Jacobian determinant of {determinant[worst].min():.2e} mm^3",
                "positive volumes everywhere",
                "repair the surface there, or choose a smaller element size",
            )
        inverse = np.linalg.inv(jacobian)
        return np.einsum("qaj,eqji->eqai", slopes, inverse), determinant * weights

    def save(self, path: Path) -> None:
        """Write the mesh as an NPZ file: first under a temporary name."""
        path.parent.mkdir(parents=True, exist_ok=True)
        # NumPy would append .npz to a name without it.
        temporary = path.with_name(f".{path.name}.{os.getpid()}.npz")
        np.savez_compressed(temporary, **{f.name: getattr(self, f.name) for f in fields(self)})
        temporary.replace(path)

    @classmethod
    def load(cls, path: Path) -> SkinMesh:
        """Read a mesh written by `save`."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(**{f.name: arrays[f.name] for f in fields(cls)})


@dataclass(frozen=True)
class MeshQuality:
    """How good the elements are."""

    elements: int
    """Number of tetrahedra."""
    nodes: int
    """Number of nodes."""
    worst_ratio: float
    """Smallest inscribed over circumscribed radius times 3 [1]: 1 for a regular tetrahedron, 0 for a flat one, less for
    one that is inside out."""
    median_ratio: float
    """Median of the same [1]."""


def quality(mesh: SkinMesh) -> MeshQuality:
    """Measure a mesh by the radius ratio of its straight-sided elements."""
    a, b, c, d = (mesh.nodes[mesh.tets[:, k]] for k in range(4))
    volume = mesh.volumes()
    area = sum(
        np.linalg.norm(np.cross(q - p, r - p), axis=1) / 2 for p, q, r in ((a, b, c), (a, b, d), (a, c, d), (b, c, d))
    )
    lengths = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (c, d), (a, c), (b, d), (a, d), (b, c))]
    x, y, z = (lengths[2 * k] * lengths[2 * k + 1] for k in range(3))
    heron = np.sqrt(np.maximum((x + y + z) * (x + y - z) * (x - y + z) * (-x + y + z), 0))
    # r = 3 V / A and R = heron / 24 |V|; four corners in one plane may leave neither.
    below = area * heron
    ratio = np.divide(216 * volume * np.abs(volume), below, out=np.zeros_like(volume), where=below > 0)
    return MeshQuality(len(mesh.tets), len(mesh.nodes), float(ratio.min()), float(np.median(ratio)))
