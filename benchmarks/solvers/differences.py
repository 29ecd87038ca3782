"""Distance of one code's solution from another's: forces, and the depth field over the whole outer face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial import Delaunay
from solvers.peer import Answer

from tacdata.indenters import Indenter
from tacdata.skin.mesh.elements import triangle_shapes

SPACING = 0.1
"""Distance of the points at which fields are compared [mm]."""

IN_CONTACT = 0.01
"""A point counts as in contact when its gap is below this share of the depth [1]."""


Touches = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""Of depth [mm], places (p, 2) [mm] and their displacements (p, 3) [mm]: which of them touch, shape (p,), bool."""


class Field:
    """Displacements of the outer face at any place: exact to its quadratic triangles."""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer

    @cached_property
    def _boxes(self) -> tuple[np.ndarray, np.ndarray]:
        corners = self._answer.places[self._answer.triangles[:, :3]]
        return corners.min(axis=1), corners.max(axis=1)

    def locate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangle of each point and its place in it (xi, eta); the nearest one for points on the rim."""
        places, triangles = self._answer.places, self._answer.triangles
        owner, inside = np.zeros(len(points), dtype=int), np.full(len(points), -np.inf)
        local = np.zeros((len(points), 2))
        for k, (low, high) in enumerate(zip(*self._boxes, strict=True)):
            near = np.flatnonzero(np.all((points >= low - 1e-6) & (points <= high + 1e-6), axis=1))
            if not len(near):
                continue
            a, b, c = places[triangles[k, :3]]
            xi = np.linalg.solve(np.stack([b - a, c - a], axis=-1), (points[near] - a).T).T
            least = np.minimum(xi.min(axis=1), 1 - xi.sum(axis=1))
            better = least > inside[near]
            owner[near[better]], local[near[better]], inside[near[better]] = k, xi[better], least[better]
        return owner, local

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the displacements at places [mm], shape (p, 2), at every depth, shape (d, p, 3)."""
        owner, local = self.locate(points)
        triangles = self._answer.triangles[owner]
        return np.einsum("pa,dpai->dpi", triangle_shapes(local), self._answer.displacement[:, triangles])


@dataclass(frozen=True)
class Reference:
    """The solution that others are compared with."""

    depth: np.ndarray
    """Depths [mm], shape (d,)."""
    points: np.ndarray
    """Places at which quadratic fields are compared [mm], shape (p, 2); linear ones are at their own vertices."""
    at: Callable[[np.ndarray], np.ndarray]
    """Displacements [mm], shape (d, p, 3), at places, shape (p, 2)."""
    touches: Touches
    """Whether places are in contact."""
    force: np.ndarray
    """Vertical force on the indenter [N], shape (d,)."""
    protrusion_force: np.ndarray
    """Vertical force on each protrusion [N], shape (d, t)."""


@dataclass(frozen=True)
class Difference:
    """One answer against a reference at one depth."""

    depth: float
    """Depth [mm]."""
    force: float
    """Of the force [%]."""
    top: float
    """Of the depth field, root of the mean square over the outer face [% of the depth]."""
    contact: float
    """The same inside the contact zone [% of the depth]."""
    largest: float
    """The largest anywhere on the outer face [% of the depth]."""
    protrusion: float
    """The largest of a protrusion's force [% of the largest of them]; NaN without a board."""


def grid(size_x: float, size_y: float) -> np.ndarray:
    """Return evenly spaced places of an outer face of that size [mm], shape (p, 2), none on its rim."""
    axes = [np.linspace(-s / 2, s / 2, round(s / SPACING) + 1) for s in (size_x, size_y)]
    axes = [(axis[1:] + axis[:-1]) / 2 for axis in axes]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def in_contact(
    indenter: Indenter, x: float, y: float, yaw: float, depth: float, points: np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """Return which places, moved by ``moved`` (p, 3), lie under the indenter with a gap below `IN_CONTACT`."""
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    dx, dy = points[:, 0] + moved[:, 0] - x, points[:, 1] + moved[:, 1] - y
    lower = indenter.profile(c * dx + s * dy, -s * dx + c * dy) - depth
    return moved[:, 2] > lower - IN_CONTACT * depth


def reference_of(answer: Answer, points: np.ndarray, touches: Touches) -> Reference:
    """Take an answer as the reference; ``points`` (p, 2) [mm] is where quadratic fields are compared."""
    return Reference(answer.depth, points, Field(answer).at, touches, answer.force, answer.protrusion_force)


def reference_from_table(
    table: dict[str, np.ndarray], force: dict, protrusions: dict, points: np.ndarray, touches: Touches
) -> Reference:
    """Take scattered displacements as the reference: columns depth, x, y, ux, uy, uz; smooth between the nodes.

    Args:
        table: The columns by name.
        force: Force [N] by depth rounded to 1e-6 mm.
        protrusions: Forces [N] on the protrusions, shape (t,), by depth.
        points: Where quadratic fields are compared [mm], shape (p, 2).
        touches: Whether places are in contact.
    """
    depths = sorted({round(float(d), 6) for d in table["depth"]})
    fields = []
    for depth in depths:
        own = np.abs(table["depth"] - depth) < 1e-6
        nodes = Delaunay(np.stack([table["x"][own], table["y"][own]], axis=-1))
        fields.append(CloughTocher2DInterpolator(nodes, np.stack([table[k][own] for k in ("ux", "uy", "uz")], axis=-1)))
    return Reference(
        np.array(depths),
        points,
        lambda places: np.array([field(places) for field in fields]),
        touches,
        np.array([force[d] for d in depths]),
        np.array([protrusions[d] for d in depths]),
    )


def differences(answer: Answer, reference: Reference) -> list[Difference]:
    """Hold an answer against a reference at the depths that both have."""
    linear = answer.triangles.shape[1] == 3
    points = answer.places if linear else reference.points
    moved = answer.displacement if linear else Field(answer).at(points)
    there = reference.at(points)
    inside = ~np.isnan(there).any(axis=(0, 2))
    found = []
    for k, depth in enumerate(answer.depth):
        where = np.flatnonzero(np.abs(reference.depth - depth) < 1e-6)
        if not len(where):
            continue
        r = int(where[0])
        off = 100 * (moved[k, :, 2] - there[r, :, 2]) / depth
        zone = reference.touches(depth, points, there[r]) & inside
        theirs, ours = reference.protrusion_force[r], answer.protrusion_force[k]
        comparable = len(theirs) and len(theirs) == len(ours)
        found.append(
            Difference(
                float(depth),
                float(100 * (answer.force[k] / reference.force[r] - 1)),
                _rms(off[inside]),
                _rms(off[zone]),
                float(np.abs(off[inside]).max()),
                float(100 * np.abs(ours - theirs).max() / theirs.max()) if comparable else float("nan"),
            )
        )
    return found


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")
