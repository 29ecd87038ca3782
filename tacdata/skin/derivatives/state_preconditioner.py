"""The preconditioner of derivatives at one state: the body at rest under that state's contact, solved exactly.

    K0 z = r + M^T Q f,     normals: Q^T M z = g,     tangents: f + D Q^T M z = e f_normal

K0 is the stiffness at rest and M the mean displacement under the hats. Q holds the normal and the tangents of active
nodes, and f the forces along them. Normal ones change the gaps by g. The others are friction, of stiffness D. Where a
node slips it grows with pressure, by e, so that the system is not symmetric. Unlike
`tacdata.skin.linear.constraint_preconditioner` it is of one state, and serves any number of right-hand sides.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear.rest_stiffness import RestSolver

_SLIPS = 1 - 1e-9
"""Shear over friction times pressure from which a node slips [1]."""


class StatePreconditioner:
    """Approximate inverse of the derivative of forces and gaps by displacements and multipliers."""

    def __init__(
        self,
        solver: RestSolver,
        surfaces: Sequence[ContactSurface],
        contacts: Sequence[ContactForces],
        friction: torch.Tensor,
        turns: Sequence[torch.Tensor],
    ) -> None:
        """Factorize.

        Args:
            solver: K0^-1 and the mortar rows of the surfaces.
            surfaces: Of the contacts.
            contacts: At the state, one member.
            friction: Coefficient [1], shape (1,).
            turns: Rotation of each contact's shape, shape (3, 3, 1).
        """
        self._rest, device = solver, friction.device
        rows, places, directions, values, normals, slots = [], [], [], [], [], []
        blocks: list[tuple[torch.Tensor, torch.Tensor, torch.Tensor]] = []
        start = row = below = slot = 0
        for surface, contact, turn in zip(surfaces, contacts, turns, strict=True):
            nodes = contact.tangent.active[:, 0].nonzero()[:, 0]
            frame = _frames(surface, contact.tangent.normal[nodes, :, 0])
            a, axes, ways = frame.shape
            diagonal = torch.arange(a, device=device)
            rows.append((below + axes * nodes[:, None] + torch.arange(axes, device=device)).flatten())
            place = row + axes * diagonal[:, None, None] + torch.arange(axes, device=device)[:, None]
            direction = start + ways * diagonal[:, None, None] + torch.arange(ways, device=device)
            places.append(place.expand_as(frame).flatten())
            directions.append(direction.expand_as(frame).flatten())
            values.append(frame.flatten())
            normals.append(start + ways * diagonal)
            slots.append(slot + nodes)
            if ways > 1:
                blocks.append((normals[-1], *_friction(contact, nodes, frame, friction, turn[:, :, 0])))
            start, row = start + ways * a, row + axes * a
            below, slot = below + axes * surface.count, slot + surface.count
        self._rows, self._normal, self._slots = torch.cat(rows), torch.cat(normals), torch.cat(slots)
        index = torch.stack([torch.cat(directions), torch.cat(places)])
        # PyTorch warns unless the check is set globally; setting it for a single tensor is not enough.
        with torch.sparse.check_sparse_tensor_invariants():
            self._along = torch.sparse_coo_tensor(index, torch.cat(values), (start, row)).coalesce()
        """Q^T."""
        self._count = below
        self._give = torch.zeros(start, start, dtype=torch.float64, device=device)
        """Stiffness along the directions: 1 over the compliance for normals, D for tangents."""
        self._factor = self._factorized(blocks) if start else None

    def _factorized(
        self, blocks: list[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]
    ) -> tuple[torch.Tensor, torch.Tensor]:
        used = torch.zeros(self._count, dtype=torch.bool, device=self._rows.device)
        used[self._rows] = True
        # Rows of the table are shared by all presses on the mesh.
        compliance = self._rest.table(used)[self._rows[:, None], self._rows].to(torch.float64)
        # Q^T C Q; C is symmetric, so that the sparse factor can stay on the left.
        projected = self._along @ (self._along @ compliance).T
        # Normals' rows would be compliances beside the pure numbers of the tangents' rows; their own compliance scales
        # them.
        self._give[self._normal, self._normal] = 1 / projected.diagonal()[self._normal]
        diagonal = torch.zeros_like(projected)
        for normal, stiffness, grows in blocks:
            tangent = normal[:, None] + torch.arange(1, 3, device=normal.device)
            self._give[tangent[:, :, None], tangent[:, None, :]] = stiffness
            diagonal[tangent, tangent] = 1.0
            diagonal[tangent, normal[:, None]] = -grows
        return torch.linalg.lu_factor(diagonal + self._give @ projected)

    def apply(self, residual: torch.Tensor, gaps: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return displacements and normal forces of nodes.

        Args:
            residual: r [N], shape (3n, c), float32.
            gaps: g: by how much mean gaps are to change [mm], at the nodes of all contacts, shape (s, c); those of
                nodes that are not active are not read.

        Returns:
            z [mm], shape (3n, c), and the forces [N], shape (s, c), 0 where not active; float32.
        """
        normal = torch.zeros_like(gaps)
        if self._factor is None:
            return self._rest.apply(residual), normal
        factor = self._factor

        def forces(moved: torch.Tensor) -> torch.Tensor:
            """Return the forces on the mortar rows that hold what they move."""
            force = -self._give @ (self._along @ moved[self._rows].to(torch.float64))
            force[self._normal] += self._give[self._normal, self._normal, None] * gaps[self._slots]
            force = torch.linalg.lu_solve(*factor, force)
            hats = torch.zeros(self._count, residual.shape[1], dtype=torch.float32, device=residual.device)
            hats[self._rows] = -(self._along.T @ force).to(torch.float32)
            normal[self._slots] = force[self._normal].to(torch.float32)
            return hats

        used = torch.zeros(self._count, residual.shape[1], dtype=torch.bool, device=residual.device)
        used[self._rows] = True
        return self._rest.held(residual, used, forces), normal


def _frames(surface: ContactSurface, normal: torch.Tensor) -> torch.Tensor:
    """Return the directions of nodes: the normal, and two tangents if there is friction, shape (a, axes, ways)."""
    if surface.flat:
        return normal[:, 2:, None]
    if not surface.rough:
        return normal[:, :, None]
    # The axis least along the normal, so that its cross product is long.
    axis = torch.nn.functional.one_hot(normal.abs().argmin(dim=1), 3).to(normal.dtype)
    first = torch.nn.functional.normalize(torch.linalg.cross(normal, axis), dim=1)
    return torch.stack([normal, first, torch.linalg.cross(normal, first)], dim=2)


def _friction(
    contact: ContactForces, nodes: torch.Tensor, frame: torch.Tensor, coefficient: torch.Tensor, turn: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return friction's stiffness [N/mm], shape (a, 2, 2), and its growth with the normal force [1], shape (a, 2)."""
    tangents = frame[:, :, 1:]
    # Stored are xx, yy, zz, xy, yz and xz.
    stiffness = contact.tangent.friction[nodes, :, 0][:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].unflatten(1, (3, 3))
    shear, limit = contact.shear[nodes, :, 0] @ turn.T, coefficient * contact.pressure[nodes, 0]
    size = torch.linalg.vector_norm(shear, dim=1)
    slips = (limit > 0) & (size >= _SLIPS * limit)
    # A slipping node carries friction times its normal force along its shear.
    slip_stiffness = torch.where(slips, coefficient / size.clamp_min(1e-30), 0.0)[:, None] * shear
    return (
        torch.einsum("aip,aij,ajq->apq", tangents, stiffness, tangents),
        torch.einsum("aip,ai->ap", tangents, slip_stiffness),
    )
