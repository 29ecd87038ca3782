"""A skin's own surface to its mesh: vertices and mid-side nodes on the surface, faces named by the sensor's rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import KDTree

from tacdata.errors import SolveError
from tacdata.sensor import Sensor
from tacdata.sensor.own_surface import PARTS, OwnSurface
from tacdata.skin.mesh.generation.curving import curve
from tacdata.skin.mesh.generation.settings import MeshSettings
from tacdata.skin.mesh.generation.tetrahedralize import tetrahedralize
from tacdata.skin.mesh.generation.topology import Quadratic, boundary, oriented, volumes, with_middles
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.surfaces.closed import read_closed
from tacdata.surfaces.creases import Creases
from tacdata.surfaces.nearest import Nearest
from tacdata.surfaces.smooth import smooth
from tacdata.surfaces.store import find

_CHORD = 5e-4
"""Height of arcs over chords that may remain of the smooth surface behind the tessellation [mm]."""

_VOLUME = 0.03
"""Share of the surface's volume that a mesh may lose or gain [1]."""

_SLIVER = 0.1
"""Share of its volume that an element must keep when its corners go to the surface [1]."""

_BEND = 0.2
"""Largest way of a mid-side node to the surface, over its edge's length [1]; longer ones are edges across a crease."""


@dataclass(frozen=True)
class _Target:
    """The surface that the mesh is put on."""

    hull: trimesh.Trimesh
    nearest: Nearest
    parent: np.ndarray
    """Face of the file that each fine triangle belongs to, shape (m,)."""
    part: np.ndarray
    """Part of each face of the file: number in `PARTS`, or -1, shape (f,)."""
    volume: float
    """Volume within the smooth surface [mm^3]."""
    outer: np.ndarray
    """Points on the outer face [mm], shape (p, 3)."""
    creases: Creases
    """Its sharp edges."""


def own_mesh(sensor: Sensor, surface: OwnSurface, settings: MeshSettings) -> SkinMesh:
    """Mesh a skin with a surface of its own.

    Raises:
        UsageError: If the surface file is not on this machine.
        FormatError: If it bounds no solid.
        SolveError: If no face is the outer one, a bonded part has none, or it cannot be meshed.
    """
    target = _target(sensor, surface)
    tree = KDTree(target.outer)
    vertices, tets = oriented(
        *tetrahedralize(target.hull, sensor.skin, settings, lambda points: tree.query(points, workers=1)[0])
    )
    vertices = _on_surface(target, vertices, tets, 2 * settings.envelope * float(target.hull.scale))
    volume = float(volumes(vertices, tets).sum())
    if abs(volume - target.volume) > _VOLUME * target.volume:
        raise SolveError(
            f"the mesh holds {volume:.4g} mm^3, skin surface {surface.file} {target.volume:.4g} mm^3",
            f"a volume within {100 * _VOLUME:g} %",
            "choose a smaller element size or envelope: thin parts were lost",
        )
    return _named(sensor, target, with_middles(vertices, tets))


def _target(sensor: Sensor, surface: OwnSurface) -> _Target:
    hull = read_closed(find(surface.file, surface.sha256, "skin"), surface.scale, "skin")
    corners = np.asarray(hull.vertices, dtype=float)
    centers, normals = np.asarray(hull.triangles_center), np.asarray(hull.face_normals)
    part = surface.parts(centers, normals, sensor.skin.protrusion_radius > 0)
    parts = ["outer", *(b for b in sensor.contact.bonded if b in PARTS)]
    parts += ["protrusions"] if sensor.contact.board else []
    for name in parts:
        if not (part == PARTS.index(name)).any():
            raise SolveError(
                f"no face of skin surface {surface.file} is chosen as {name}",
                "at least one face for the outer face, every bonded part, and protrusions on a board",
                f"correct skin/surface/{name}: normal, angle, low and high of its faces",
            )
    points, triangles, parent = smooth(corners, np.asarray(hull.faces)).divided(_CHORD)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    outer = points[triangles[part[parent] == PARTS.index("outer")]].reshape(-1, 3)
    # Divergence theorem: signed tetrahedra from the origin to every triangle.
    volume = float(np.einsum("ij,ij->", np.cross(a, b), c) / 6)
    creases = Creases.of(corners, np.asarray(hull.faces))
    return _Target(hull, Nearest(points, triangles), parent, part, volume, outer, creases)


def _on_surface(target: _Target, vertices: np.ndarray, tets: np.ndarray, reach: float) -> np.ndarray:
    """Return vertices with those of the boundary on the surface, but for those that would flatten an element.

    Those within ``reach`` [mm] of a sharp edge go to it: the nearest face alone would round the edge off.
    """
    surface = np.unique(boundary(tets))
    # Creases first: a vertex near one belongs on it, or the mesh rounds the edge off.
    place, sharp = target.creases.snapped(vertices[surface], reach)
    place[~sharp] = target.nearest.places(vertices[surface[~sharp]]).point
    places = vertices.copy()
    places[surface] = place
    for _ in range(10):
        flat = volumes(places, tets) < _SLIVER * volumes(vertices, tets)
        if not flat.any():
            break
        back = np.unique(tets[flat])
        places[back] = vertices[back]
    return places


def _named(sensor: Sensor, target: _Target, body: Quadratic) -> SkinMesh:
    faces = boundary(body.tets[:, :4])
    part = target.part[target.parent[target.nearest.places(body.nodes[faces].mean(axis=1)).face]]
    sixes = {name: body.triangles(faces[part == number]) for number, name in enumerate(PARTS)}
    nodes = _round(target, body, body.triangles(faces))
    bumps = sixes["protrusions"]
    away = np.linalg.norm(nodes[bumps[:, :3], :2].mean(axis=1)[:, None] - sensor.taxels.centers[None], axis=-1)
    parts = {}
    for name in ("sides", "bottom"):
        parts[name] = np.zeros(len(nodes), dtype=bool)
        parts[name][sixes[name].ravel()] = True
    taxel = away.argmin(axis=1).astype(np.int32) if len(bumps) else np.zeros(0, np.int32)
    return SkinMesh(nodes, body.tets, sixes["outer"], bumps, taxel, parts["sides"], parts["bottom"])


def _round(target: _Target, body: Quadratic, surface: np.ndarray) -> np.ndarray:
    """Return nodes with the mid-sides of the boundary (f, 6) on the smooth surface, but across creases."""
    base = len(body.nodes) - len(body.edges)
    middle = np.unique(surface[:, 3:])
    edge = body.edges[middle - base]
    length = np.linalg.norm(body.nodes[edge[:, 1]] - body.nodes[edge[:, 0]], axis=1)
    place = target.nearest.places(body.nodes[middle])
    near = np.abs(place.distance) < _BEND * length
    targets = body.nodes.copy()
    targets[middle[near]] = place.point[near]
    return curve(body.nodes, targets, body.tets)
