"""Sensor geometry to mesh: a trimesh surface, tetrahedralized by fTetWild, put back on the true faces, made quadratic.

fTetWild (Hu et al. 2020) keeps the surface only within an envelope; so vertices are snapped to the planes and spheres
that they belong to, and the mid-side nodes of protrusion faces are put on the true sphere.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import trimesh

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.skin import elements
from tacdata.skin.mesh import SkinMesh

RECIPE = 2
"""Raised when this file would make another mesh from the same settings."""

PINNED = Path(__file__).parent / "meshes"
"""Meshes that ship with the model; made by `python -m tacdata.skin.pin_mesh`."""

_SNAP = 0.1
"""Distance within which a surface vertex belongs to a plane [mm]; above fTetWild's envelope."""

_SNAP_SPHERE = 0.25
"""The same for a protrusion, over its radius [1]; above the sagitta of `_RINGS`."""


_SLIVER = 0.02
"""Share of its volume that an element must keep when its corners go to the true faces [1]."""

_VOLUME = 0.03
"""Share of the skin's volume that a mesh may lose or gain; coarse protrusions lose 1 % of a small skin [1]."""

_RINGS = ((30.0, 6, 0.0), (90.0, 8, 0.5))
"""Rings of vertices on a protrusion: polar angle from the tip [deg], vertices, turn [vertices].

The inner ring encloses the contact patch."""


@dataclass(frozen=True)
class MeshSettings:
    """Target edge lengths [mm]."""

    outer: float = 0.6
    """At the outer face [mm]."""
    interior: float = 2.0
    """In the middle of the slab [mm]."""
    protrusion: float = 1.2
    """At the protrusions [mm]."""
    envelope: float = 1e-3
    """fTetWild's envelope over the bounding box's diagonal [1]."""
    focus: tuple[float, float, float, float] | None = None
    """A disc of the outer face to refine: x, y, radius, edge length [mm]."""


def build_mesh(sensor: Sensor, settings: MeshSettings) -> SkinMesh:
    """Return the mesh of a sensor's skin: the one that ships with the model, one made before, or a new one.

    fTetWild does not give the same mesh twice. So the default sensor's mesh ships with the model, that labels are the
    same on every machine; any other is made once for each user and kept.

    Raises:
        SolveError: If the geometry cannot be meshed.
    """
    key = mesh_key(sensor, settings)
    for path in (PINNED / f"{key}.npz", _cache() / "meshes" / f"{key}.npz"):
        if path.exists():
            return SkinMesh.load(path)
    mesh = make_mesh(sensor, settings)
    mesh.save(path)
    # Where two processes made it at once, the last to write decides for both.
    return SkinMesh.load(path)


def mesh_key(sensor: Sensor, settings: MeshSettings) -> str:
    """Return the name under which a mesh is kept: a hash of what it is made from (32 hex digits)."""
    centers = sensor.taxels.centers.tolist() if sensor.skin.protrusion_radius else []
    made_from = {"recipe": RECIPE, "skin": asdict(sensor.skin), "protrusions": centers, "settings": asdict(settings)}
    return provenance.content_hash(made_from)[:32]


def make_mesh(sensor: Sensor, settings: MeshSettings) -> SkinMesh:
    """Mesh a sensor's skin anew.

    Raises:
        SolveError: If the geometry cannot be meshed.
    """
    return quadratic(sensor, *_tetrahedralize(sensor, settings))


def _cache() -> Path:
    root = os.environ.get("TACDATA_CACHE")
    return Path(root) if root else Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "tacdata"


def surface(sensor: Sensor) -> trimesh.Trimesh:
    """Return the closed surface of slab and protrusions [mm, sensor frame]."""
    skin = sensor.skin
    slab = trimesh.creation.box(extents=[skin.size_x, skin.size_y, skin.thickness])
    slab.apply_translation([0, 0, skin.thickness / 2])
    if not skin.protrusion_radius:
        return slab
    parts = [slab]
    for x, y in sensor.taxels.centers:
        bump = _bump(skin.protrusion_radius, min(0.5 * skin.thickness, skin.protrusion_radius))
        bump.apply_translation([x, y, 0])
        parts.append(bump)
    return trimesh.boolean.union(parts, engine="manifold")


def _bump(radius: float, root: float) -> trimesh.Trimesh:
    """Return a coarse hemisphere below z = 0, vertices on the sphere, with a prism of height ``root`` above it."""
    tip = [[0.0, 0.0, -radius]]
    rings = [(np.radians(polar), count, turn) for polar, count, turn in _RINGS]
    for polar, count, turn in rings:
        angle = 2 * np.pi * (np.arange(count) + turn) / count
        wide, low = radius * np.sin(polar), -radius * np.cos(polar)
        tip += [[wide * np.cos(a), wide * np.sin(a), low] for a in angle]
    tip += [[x, y, root] for x, y, _ in tip[-rings[-1][1] :]]
    return trimesh.Trimesh(tip).convex_hull


def _tetrahedralize(sensor: Sensor, settings: MeshSettings) -> tuple[np.ndarray, np.ndarray]:
    import pytetwild

    hull = surface(sensor)
    points, cells, size = _background(sensor, settings)
    # fTetWild leaves a file of its own in the working folder.
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        vertices, tets = pytetwild.tetrahedralize(  # pyright: ignore[reportPrivateImportUsage]
            hull.vertices, hull.faces.astype(np.int32), edge_length_abs=settings.interior, epsilon=settings.envelope,
            num_threads=1, bg_vertices=points, bg_tets=cells, bg_values=size,
        )
    return np.asarray(vertices, dtype=float), np.asarray(tets, dtype=np.int32)


def _background(sensor: Sensor, settings: MeshSettings) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a background mesh that carries the target edge length: points [mm], tetrahedra, values [mm]."""
    skin = sensor.skin
    step = 0.5
    axes = [
        np.arange(-skin.size_x / 2 - step, skin.size_x / 2 + 1.5 * step, step),
        np.arange(-skin.size_y / 2 - step, skin.size_y / 2 + 1.5 * step, step),
        np.arange(-skin.protrusion_radius - step, skin.thickness + 1.5 * step, step / 2),
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    n = points.shape[:3]
    index = np.arange(np.prod(n)).reshape(n)
    corner = {
        bits: index[bits[0] : n[0] - 1 + bits[0], bits[1] : n[1] - 1 + bits[1], bits[2] : n[2] - 1 + bits[2]].ravel()
        for bits in np.ndindex(2, 2, 2)
    }
    # Kuhn's division of a cube: the six monotone paths from corner 000 to corner 111.
    cells = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        bits, path = [0, 0, 0], [corner[0, 0, 0]]
        for axis in order:
            bits[axis] = 1
            path.append(corner[bits[0], bits[1], bits[2]])
        cells.append(np.stack(path, axis=-1))
    flat = points.reshape(-1, 3)
    below = skin.thickness - flat[:, 2]
    blend = np.clip(below / (0.5 * skin.thickness), 0, 1)
    size = settings.outer + (settings.interior - settings.outer) * blend
    if skin.protrusion_radius:
        size = np.where(flat[:, 2] < 0.3, np.minimum(size, settings.protrusion), size)
    if settings.focus:
        x, y, radius, fine = settings.focus
        away = np.maximum(np.hypot(flat[:, 0] - x, flat[:, 1] - y) - radius, 0)
        size = np.minimum(size, fine + 0.5 * np.hypot(away, np.maximum(below, 0)))
    return flat, np.concatenate(cells).astype(np.int32), size


def quadratic(sensor: Sensor, vertices: np.ndarray, tets: np.ndarray) -> SkinMesh:
    """Snap the surface to the true faces, add mid-side nodes, and name the parts of the surface.

    Args:
        sensor: Whose skin it is.
        vertices: Corner positions [mm], shape (v, 3).
        tets: Corners of each tetrahedron, shape (e, 4).

    Raises:
        SolveError: If an element cannot be kept right side out.
    """
    used, tets = np.unique(tets, return_inverse=True)
    vertices, tets = vertices[used].copy(), tets.reshape(-1, 4)
    flip = _volume(vertices, tets) < 0
    tets[flip] = tets[flip][:, [0, 2, 1, 3]]
    skin = sensor.skin
    for _ in range(5):
        faces = _boundary(tets)
        surface_vertices = np.unique(faces)
        snapped, on_sphere, taxel = _snap(sensor, vertices, surface_vertices)
        flat = _volume(snapped, tets) < _SLIVER * _volume(vertices, tets)
        # A tetrahedron with all corners on one true face has no volume left: the face passes under it.
        drop = flat & np.isin(tets, surface_vertices).all(axis=1)
        if not flat.any():
            break
        _center(vertices, snapped, tets, np.setdiff1d(tets[flat & ~drop], surface_vertices))
        tets = tets[~drop]
    vertices = snapped
    _check_volume(sensor, float(_volume(vertices, tets).sum()))
    edges, inverse = np.unique(
        np.sort(tets[:, elements.EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    middle = vertices[edges].mean(axis=1)
    edge_number = {tuple(e): len(vertices) + k for k, e in enumerate(edges.tolist())}
    tet10 = np.concatenate([tets, len(vertices) + inverse.reshape(-1, 6)], axis=1).astype(np.int32)

    def six(triangles: np.ndarray) -> np.ndarray:
        mids = [
            [edge_number[tuple(sorted((t[a], t[b])))] for a, b in elements.FACE_EDGES] for t in triangles.tolist()
        ]
        return np.concatenate([triangles, np.array(mids).reshape(-1, 3)], axis=1).astype(np.int32)

    z = vertices[faces][:, :, 2]
    is_outer = np.all(np.abs(z - skin.thickness) < 1e-9, axis=1)
    is_bump = np.all(on_sphere[faces], axis=1) & ~np.all(np.abs(z) < 1e-9, axis=1)
    outer, bumps = six(faces[is_outer]), six(faces[is_bump])
    nodes = np.concatenate([vertices, middle])
    bump_taxel = taxel[faces[is_bump]].max(axis=1).astype(np.int32)
    nodes = _curve(sensor, nodes, tet10, bumps, bump_taxel)
    tolerance = 1e-9
    sides = (np.abs(np.abs(nodes[:, 0]) - skin.size_x / 2) < tolerance) | (
        np.abs(np.abs(nodes[:, 1]) - skin.size_y / 2) < tolerance
    )
    sides &= nodes[:, 2] > -tolerance
    bottom = np.zeros(len(nodes), dtype=bool)
    flat = np.all(np.abs(z) < tolerance, axis=1)
    bottom[six(faces[flat]).ravel()] = True
    return SkinMesh(nodes, tet10, outer, bumps, bump_taxel, sides, bottom)


def _check_volume(sensor: Sensor, found: float) -> None:
    """Refuse a mesh that lost part of the skin; ``found`` is its volume by corners [mm^3]."""
    skin = sensor.skin
    true = skin.size_x * skin.size_y * skin.thickness
    if skin.protrusion_radius:
        true += sensor.taxels.count * 2 / 3 * np.pi * skin.protrusion_radius**3
    if abs(found - true) > _VOLUME * true:
        raise SolveError(
            f"the mesh holds {found:.3g} mm^3, the skin {true:.3g} mm^3: faces closer than {_SNAP:g} mm collapsed",
            f"a volume within {100 * _VOLUME:g} %",
            f"check the skin's sizes (all above {2 * _SNAP:g} mm), or choose a smaller element size",
        )


def _center(vertices: np.ndarray, snapped: np.ndarray, tets: np.ndarray, inner: np.ndarray) -> None:
    """Move inner vertices, whose elements the snapped surface has flattened, to the mean of their neighbours."""
    for vertex in inner:
        around = np.setdiff1d(tets[(tets == vertex).any(axis=1)], [vertex])
        vertices[vertex] = snapped[around].mean(axis=0)


def _volume(vertices: np.ndarray, tets: np.ndarray) -> np.ndarray:
    a, b, c, d = (vertices[tets[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def _boundary(tets: np.ndarray) -> np.ndarray:
    """Return the triangles that belong to one tetrahedron only, normals outward, shape (f, 3)."""
    faces = tets[:, elements.FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def _snap(
    sensor: Sensor, vertices: np.ndarray, surface_vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Put surface vertices on their true faces; return positions, "lies on a sphere", the sphere's taxel (or -1)."""
    skin, moved = sensor.skin, vertices.copy()
    on_sphere = np.zeros(len(vertices), dtype=bool)
    taxel = np.full(len(vertices), -1)
    p = moved[surface_vertices]
    for axis, half in ((0, skin.size_x / 2), (1, skin.size_y / 2)):
        near = (np.abs(np.abs(p[:, axis]) - half) < _SNAP) & (p[:, 2] > -_SNAP)
        p[near, axis] = np.sign(p[near, axis]) * half
    p[np.abs(p[:, 2] - skin.thickness) < _SNAP, 2] = skin.thickness
    if skin.protrusion_radius:
        centers, radius = sensor.taxels.centers, skin.protrusion_radius
        offset = p[:, None, :2] - centers[None]
        nearest = np.hypot(offset[..., 0], offset[..., 1]).argmin(axis=1)
        radial = offset[np.arange(len(p)), nearest]
        reach = np.sqrt((radial**2).sum(axis=1) + np.minimum(p[:, 2], 0) ** 2)
        bump = (p[:, 2] < _SNAP / 2) & (np.abs(reach - radius) < _SNAP_SPHERE * radius)
        bump &= (p[:, 2] < -_SNAP / 2) | (np.abs(reach - radius) < _SNAP)
        rim = bump & (p[:, 2] > -_SNAP / 2)
        p[rim, 2] = 0.0
        scale = radius / np.sqrt((radial**2).sum(axis=1) + np.minimum(p[:, 2], 0) ** 2)
        p[bump, :2] = centers[nearest[bump]] + radial[bump] * scale[bump, None]
        p[bump & ~rim, 2] *= scale[bump & ~rim]
        on_sphere[surface_vertices] = bump
        taxel[surface_vertices] = np.where(bump, nearest, -1)
    else:
        bump = np.zeros(len(p), dtype=bool)
    p[(np.abs(p[:, 2]) < _SNAP) & ~bump, 2] = 0.0
    moved[surface_vertices] = p
    return moved, on_sphere, taxel


def _curve(sensor: Sensor, nodes: np.ndarray, tets: np.ndarray, bumps: np.ndarray, taxel: np.ndarray) -> np.ndarray:
    """Put mid-side nodes of protrusion faces on the true sphere where the element allows it."""
    if not len(bumps):
        return nodes
    curved = nodes.copy()
    radius = sensor.skin.protrusion_radius
    for k in range(3, 6):
        index = bumps[:, k]
        center = np.concatenate([sensor.taxels.centers[taxel], np.zeros((len(taxel), 1))], axis=1)
        radial = nodes[index] - center
        curved[index] = center + radial * (radius / np.linalg.norm(radial, axis=1, keepdims=True))
    points, _ = elements.tetrahedron_quadrature()
    slopes = elements.tetrahedron_gradients(points)
    for _ in range(5):
        jacobian = np.einsum("eai,qaj->eqij", curved[tets], slopes)
        straight = np.linalg.det(np.einsum("eai,qaj->eqij", nodes[tets], slopes))
        bad = np.any(np.linalg.det(jacobian) < 0.2 * straight, axis=1)
        if not bad.any():
            break
        # An element too flat to follow the sphere keeps its straight edges; the chord error there is a few micrometres.
        index = np.unique(tets[bad][:, 4:])
        curved[index] = nodes[index]
    if _volume(curved, tets[:, :4]).min() <= 0:
        worst = int(_volume(curved, tets[:, :4]).argmin())
        place = curved[tets[worst, :4]].mean(axis=0).round(2).tolist()
        raise SolveError(
            f"element {worst} at {place} mm is flat after snapping to the surface",
            "positive volumes", "choose a smaller element size or envelope in the mesh settings",
        )
    return curved
