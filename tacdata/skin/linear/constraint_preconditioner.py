"""The preconditioner of Newton's system: the body at rest with the present contact constraints, solved exactly.

    [K0 + T^T D T   B^T] [z]   [r]
    [B               0 ] [y] = [c]

K0 is the stiffness at rest, B the mean normal displacement under the hats of active nodes, T their mean slip and D
friction's stiffness. A constraint preconditioner (Keller, Gould and Wathen, SIAM J. Matrix Anal. Appl. 21 (2000) 1300).
Friction enters as constraints that give way by D^-1. All that is left is the dense compliance of the active nodes,

    S = Q^T G Q + diag(0, D^-1),     G = M K0^-1 M^T,

with M the mortar rows and Q each node's normal and tangents. M never changes, so entries of G serve all presses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear.rest_stiffness import RestSolver

_SOFT = 1e3
"""Compliance of a slipping node, over the body's at the same node, up to which friction enters [1]: beyond, it is
nothing."""

_ROWS = 32
"""Active nodes are padded to a multiple of this."""


class ConstraintPreconditioner:
    """Approximate inverse of Newton's system for every member of a batch; the first surface may be rough."""

    def __init__(self, rest: RestSolver, surfaces: Sequence[ContactSurface], modulus: float) -> None:
        """Bind K0^-1 and the contact surfaces.

        Args:
            rest: K0^-1 of the nominal material; its rows are `mortar_rows` of the surfaces.
            surfaces: Whose constraints are held.
            modulus: Young's modulus [MPa] of the nominal material.
        """
        self.rest, self._surfaces, self._modulus = rest, tuple(surfaces), modulus
        self._base, base = [], 0
        for surface in surfaces:
            self._base.append(base)
            base += surface.count * (1 if surface.flat else 3)
        self._count = base
        self._nodes: list[torch.Tensor] = []
        """Active nodes of each member, by contact, shape (b, a); the count of all stands for none."""
        self._frames: list[torch.Tensor] = []
        """Normal and tangents of each of them, shape (b, a, axes, directions)."""
        self._rows = torch.empty(0)
        self._factor = torch.empty(0)
        self._scale = torch.empty(0)
        self._is_normal = torch.empty(0)

    def update(self, contacts: Sequence[ContactTangent], modulus: torch.Tensor) -> None:
        """Prepare for the present active nodes.

        Args:
            contacts: Of each surface.
            modulus: Young's modulus of each member [MPa], shape (b,).
        """
        self._scale = (self._modulus / modulus).to(torch.float32)
        self._nodes, self._frames, rows, extra = [], [], [], []
        for surface, contact, base in zip(self._surfaces, contacts, self._base, strict=True):
            nodes = _padded(contact.active)
            self._nodes.append(nodes)
            frame = _frames(contact, nodes, surface)
            self._frames.append(frame)
            axes = frame.shape[2]
            numbers = base + axes * nodes[:, :, None] + torch.arange(axes, device=nodes.device)
            numbers[nodes == surface.count] = self._count
            rows.append(numbers.flatten(1))
            extra.append(_friction(contact, nodes, frame, surface))
        self._rows = torch.cat(rows, dim=1)
        compliance = self.rest.compliance(self._rows) * self._scale[:, None, None]
        self._factor = self._factorized(compliance.to(torch.float64), extra)

    def _factorized(self, compliance: torch.Tensor, extra: list[torch.Tensor | None]) -> torch.Tensor:
        """Return the Cholesky factor of S, shape (b, m, m)."""
        turned = self._turn(self._turn(compliance).transpose(1, 2))
        start, parts = 0, []
        for frame, stiffness in zip(self._frames, extra, strict=True):
            b, a, _, directions = frame.shape
            parts.append(torch.arange(a * directions, device=frame.device) % directions == 0)
            if stiffness is not None:
                block = turned.diagonal(dim1=1, dim2=2)[:, start : start + a * directions].reshape(b, a, directions)
                floor = 1 / (_SOFT * block[:, :, 1:].clamp_min(1e-30))
                soft = torch.linalg.inv(stiffness + torch.diag_embed(floor))
                index = start + directions * torch.arange(a, device=frame.device)[:, None] + torch.arange(1, directions)
                turned[:, index[:, :, None], index[:, None, :]] += soft
            start += a * directions
        self._is_normal = torch.cat(parts)
        diagonal = turned.diagonal(dim1=1, dim2=2)
        # A slot that stands for nothing must not make the matrix singular.
        diagonal.add_((diagonal <= 0).to(diagonal.dtype))
        return torch.linalg.cholesky(turned).to(torch.float32)

    def _turn(self, values: torch.Tensor) -> torch.Tensor:
        """Return values of all rows, shape (b, rows, ...), along each node's directions, shape (b, m, ...)."""
        start, parts = 0, []
        for frame in self._frames:
            b, a, axes, directions = frame.shape
            own = values[:, start : start + a * axes].reshape(b, a, axes, math.prod(values.shape[2:]))
            part = torch.einsum("baip,baic->bapc", frame.to(values.dtype), own)
            parts.append(part.reshape(b, a * directions, *values.shape[2:]))
            start += a * axes
        return torch.cat(parts, dim=1)

    def _turn_back(self, values: torch.Tensor) -> torch.Tensor:
        """Return forces along directions, shape (b, m), on all rows, shape (b, rows)."""
        start, parts = 0, []
        for frame in self._frames:
            b, a, _, directions = frame.shape
            own = values[:, start : start + a * directions].reshape(b, a, directions)
            parts.append(torch.einsum("baip,bap->bai", frame.to(values.dtype), own).reshape(b, -1))
            start += a * directions
        return torch.cat(parts, dim=1)

    def apply(
        self, residual: torch.Tensor, gaps: Sequence[torch.Tensor] | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return z and y for residuals r.

        Args:
            residual: r [N], shape (n, 3, b), float32.
            gaps: c: by how much the mean gaps are to change [mm], by contact, shape (s, b); None: not at all.

        Returns:
            z [mm], shape (n, 3, b), and y [N] along each active node's directions, shape (b, m); see `forces`.
        """
        r = residual.reshape(-1, residual.shape[-1])
        z = self.rest.apply(r) * self._scale
        y = torch.zeros(r.shape[1], 0, device=r.device)
        if self._rows.shape[1]:
            moved = torch.nn.functional.pad(self.rest.rows(z), (0, 0, 0, 1))
            v = self._turn(moved.T.gather(1, self._rows))
            if gaps is not None:
                v = v - self._wanted(gaps)
            y = torch.cholesky_solve(v[:, :, None], self._factor)[:, :, 0]
            forces = torch.zeros(r.shape[1], self._count + 1, dtype=r.dtype, device=r.device)
            # A member's rows are all different, the one that stands for none aside.
            forces.scatter_(1, self._rows, self._turn_back(y))
            z = self.rest.apply(r - self.rest.spread(forces[:, :-1].T)) * self._scale
        return z.reshape(residual.shape), y

    def _wanted(self, gaps: Sequence[torch.Tensor]) -> torch.Tensor:
        parts = []
        for nodes, frame, gap in zip(self._nodes, self._frames, gaps, strict=True):
            own = torch.nn.functional.pad(gap, (0, 0, 0, 1)).T.gather(1, nodes).to(torch.float32)
            wanted = torch.zeros(*own.shape, frame.shape[3], dtype=torch.float32, device=own.device)
            wanted[:, :, 0] = own
            parts.append(wanted.flatten(1))
        return torch.cat(parts, dim=1)

    def forces(self, y: torch.Tensor) -> list[torch.Tensor]:
        """Return the normal forces of `apply`'s y [N] by contact, shape (s, b), 0 where not active."""
        start, parts = 0, []
        for surface, nodes, frame in zip(self._surfaces, self._nodes, self._frames, strict=True):
            b, a, _, directions = frame.shape
            own = y[:, start : start + a * directions].reshape(b, a, directions)[:, :, 0]
            result = torch.zeros(b, surface.count + 1, dtype=torch.float64, device=y.device)
            result.scatter_(1, nodes, own.to(torch.float64))
            parts.append(result[:, :-1].T.contiguous())
            start += a * directions
        return parts


def _padded(active: torch.Tensor) -> torch.Tensor:
    """Return the indices of each member's active nodes, shape (b, a), the number of all nodes where there is none."""
    count = len(active)
    most = int(active.sum(dim=0).max()) if count else 0
    most = min(-(-most // _ROWS) * _ROWS, count)
    index = torch.where(active, torch.arange(count, device=active.device)[:, None], count)
    return index.sort(dim=0).values[:most].T.contiguous()


def _frames(contact: ContactTangent, nodes: torch.Tensor, surface: ContactSurface) -> torch.Tensor:
    """Return each node's directions: the normal, and two tangents if there is friction, shape (b, a, axes, d)."""
    padded = torch.nn.functional.pad(contact.normal, (0, 0, 0, 0, 0, 1))
    normal = padded.permute(2, 0, 1).gather(1, nodes[:, :, None].expand(-1, -1, 3))
    if surface.flat:
        return normal[:, :, 2:, None]
    if not surface.rough:
        return normal[:, :, :, None]
    # The axis least along the normal, so that its cross product is long.
    axis = torch.nn.functional.one_hot(normal.abs().argmin(dim=2), 3).to(normal.dtype)
    first = torch.linalg.cross(normal, axis)
    first = first / torch.linalg.vector_norm(first, dim=2, keepdim=True).clamp_min(1e-12)
    return torch.stack([normal, first, torch.linalg.cross(normal, first)], dim=3)


def _friction(
    contact: ContactTangent, nodes: torch.Tensor, frame: torch.Tensor, surface: ContactSurface
) -> torch.Tensor | None:
    """Return friction's stiffness along the tangents [N/mm], shape (b, a, 2, 2); None without friction."""
    if not surface.rough or surface.flat:
        return None
    packed = torch.nn.functional.pad(contact.friction, (0, 0, 0, 0, 0, 1)).permute(2, 0, 1)
    own = packed.gather(1, nodes[:, :, None].expand(-1, -1, 6))
    full = own[:, :, [0, 3, 5, 3, 1, 4, 5, 4, 2]].unflatten(2, (3, 3))
    tangents = frame[:, :, :, 1:]
    return torch.einsum("baip,baij,bajq->bapq", tangents, full, tangents)
