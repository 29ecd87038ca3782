"""CalculiX's input of a press: our mesh as C3D10, the indenter and the board as meshes of their own, face to face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tacdata.cases.case import Case
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh

FACE_NAMES = {
    frozenset((0, 1, 2)): "S1",
    frozenset((0, 1, 3)): "S2",
    frozenset((1, 2, 3)): "S3",
    frozenset((0, 2, 3)): "S4",
}
"""CalculiX's name of a tetrahedron's face, by its corners."""


@dataclass(frozen=True)
class Rigid:
    """A rigid body: quadratic hexahedra, one layer thick, all of whose nodes are prescribed."""

    nodes: np.ndarray
    """Positions [mm], shape (n, 3)."""
    hexahedra: np.ndarray
    """C3D20 elements, shape (e, 20); the side S1 faces the skin."""


def shell(lower: np.ndarray, thickness: float) -> Rigid:
    """Return a layer over a grid of points.

    Args:
        lower: The side that faces the skin [mm], shape (2a + 1, 2b + 1, 3): corners at even indices, the points between
            them at odd ones; the normal of (first, second) points along z, and so does the layer.
        thickness: Of the layer, along z [mm]; negative to lie below.
    """
    rows, columns = lower.shape[:2]
    levels = np.stack([lower + np.array([0, 0, t * thickness]) for t in (0.0, 0.5, 1.0)])
    index = np.arange(levels[..., 0].size).reshape(levels.shape[:3])
    i, j = (g.ravel() for g in np.meshgrid(np.arange(0, rows - 2, 2), np.arange(0, columns - 2, 2), indexing="ij"))
    ring = [(0, 0), (2, 0), (2, 2), (0, 2)]
    middle = [(1, 0), (2, 1), (1, 2), (0, 1)]
    places = [(0, *p) for p in ring] + [(2, *p) for p in ring] + [(0, *p) for p in middle]
    places += [(2, *p) for p in middle] + [(1, *p) for p in ring]
    if thickness < 0:  # mirrored: turn the rings round, so that volumes stay positive
        turn = [0, 3, 2, 1]
        ring, middle = [ring[k] for k in turn], [middle[k] for k in (3, 2, 1, 0)]
        places = [(0, *p) for p in ring] + [(2, *p) for p in ring] + [(0, *p) for p in middle]
        places += [(2, *p) for p in middle] + [(1, *p) for p in ring]
    hexahedra = np.stack([index[k, i + di, j + dj] for k, di, dj in places], axis=-1)
    used, hexahedra = np.unique(hexahedra, return_inverse=True)
    return Rigid(levels.reshape(-1, 3)[used], hexahedra.reshape(-1, 20))


def indenter_grid(case: Case, spacing: float) -> np.ndarray:
    """Return points on the indenter's lower side, a little wider than the deepest press needs [mm]."""
    request = case.request
    reach = request.indenter.footprint(max(request.depths) + 0.4, 0.0)
    counts = [2 * max(4, int(np.ceil(2 * r / spacing))) + 1 for r in reach]
    # A square grid drawn into the disc of the footprint: no corner is higher than the rim.
    s, t = np.meshgrid(*(np.linspace(-1, 1, c) for c in counts), indexing="ij")
    x, y = s * np.sqrt(1 - t**2 / 2), t * np.sqrt(1 - s**2 / 2)
    x, y = reach[0] * x * (1 - 1e-9), reach[1] * y * (1 - 1e-9)
    z = request.indenter.profile(x, y)
    c, w = np.cos(np.radians(request.yaw)), np.sin(np.radians(request.yaw))
    place = np.stack([request.x + c * x - w * y, request.y + w * x + c * y, case.sensor.skin.thickness + z], axis=-1)
    return place


def board_plate(center: np.ndarray, half: float, height: float) -> np.ndarray:
    """Return a square of the board, shape (3, 3, 3) [mm]; turned over, as the skin is above it."""
    s = np.linspace(-half, half, 3)
    x, y = np.meshgrid(center[0] + s, center[1] + s, indexing="ij")
    return np.stack([x, y, np.full_like(x, height)], axis=-1)


def nodes(numbers: np.ndarray, positions: np.ndarray) -> list[str]:
    """Return node lines."""
    return ["*NODE", *(f"{n},{x:.12g},{y:.12g},{z:.12g}" for n, (x, y, z) in zip(numbers, positions, strict=True))]


def hexahedra(name: str, first_element: int, first_node: int, rigid: Rigid) -> list[str]:
    """Return element lines of a rigid body, and the surface that faces the skin."""
    lines = [f"*ELEMENT,TYPE=C3D20,ELSET={name}"]
    for k, nodes_of in enumerate(rigid.hexahedra + first_node):
        entries = [str(first_element + k), *map(str, nodes_of)]
        lines += [",".join(entries[:12]) + ",", ",".join(entries[12:])]
    lines += [f"*SOLID SECTION,ELSET={name},MATERIAL=STEEL"]
    lines += [f"*SURFACE,NAME=F{name}", *(f"{first_element + k},S1" for k in range(len(rigid.hexahedra)))]
    return lines


def node_set(name: str, numbers: np.ndarray) -> list[str]:
    """Return a node set."""
    return [f"*NSET,NSET={name}", *(f"{n}," for n in numbers)]


def skin(mesh: SkinMesh) -> list[str]:
    """Return nodes and C3D10 elements of the skin; our node order is CalculiX's."""
    lines = nodes(np.arange(1, len(mesh.nodes) + 1), mesh.nodes)
    lines.append("*ELEMENT,TYPE=C3D10,ELSET=SKIN")
    lines += [f"{k + 1}," + ",".join(map(str, tet)) for k, tet in enumerate(mesh.tets + 1)]
    return [*lines, "*SOLID SECTION,ELSET=SKIN,MATERIAL=RUBBER"]


def faces(name: str, mesh: SkinMesh, triangles: np.ndarray) -> list[str]:
    """Return a surface made of faces of the skin's elements."""
    owner = {}
    for tet, corners in enumerate(mesh.tets[:, :4].tolist()):
        for face in elements.FACES:
            owner[frozenset(corners[k] for k in face)] = (tet, FACE_NAMES[frozenset(face)])
    found = [owner[frozenset(three)] for three in triangles[:, :3].tolist()]
    return [f"*SURFACE,NAME={name}", *(f"{tet + 1},{side}" for tet, side in found)]
