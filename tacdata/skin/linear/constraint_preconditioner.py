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

from collections.abc import Sequence

import torch

from tacdata.skin.contact.contact_forces import ContactTangent
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.linear import constraint_kernels as kernels
from tacdata.skin.linear.constraint_rows import ActiveRows
from tacdata.skin.linear.constraint_solvers import FactoredCompliance, InvertedCompliance
from tacdata.skin.linear.rest_stiffness import RestSolver


class ConstraintPreconditioner:
    """Approximate inverse of Newton's system for every member of a batch; the first surface may be rough."""

    def __init__(self, solver: RestSolver, surfaces: Sequence[ContactSurface], modulus: float) -> None:
        """Bind K0^-1 and the contact surfaces.

        Args:
            solver: K0^-1 of the nominal material; its rows are `mortar_rows` of the surfaces.
            surfaces: Whose constraints are held.
            modulus: Young's modulus [MPa] of the nominal material.
        """
        self.rest, self._modulus = solver, modulus
        self.solver = compliance_solver(solver.device)
        """S^-1 of each member."""
        self.rows = ActiveRows(surfaces, solver, self.solver.STEP)
        """The present constraints."""
        self.scale = torch.empty(0)
        """Nominal modulus over each member's [1], shape (b,)."""

    def update(self, contacts: Sequence[ContactTangent], modulus: torch.Tensor) -> None:
        """Prepare for the present active nodes.

        Args:
            contacts: Of each surface.
            modulus: Young's modulus of each member [MPa], shape (b,).
        """
        # K0 has the nominal modulus. Compliance is inversely proportional to the modulus, so one factor per member
        # suffices.
        self.scale = (self._modulus / modulus).to(torch.float32)
        changed = self.rows.update(contacts, self.scale)
        self.solver.update(self.rows.sizes, changed, self.rows.most, self.rows.compliance, modulus.device)

    def apply(
        self, residual: torch.Tensor, gaps: Sequence[torch.Tensor] | None = None, member: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return z and y for residuals r.

        Args:
            residual: r [N], shape (n, 3, b), float32.
            gaps: c: by how much the mean gaps are to change [mm], by contact, shape (s, b) of the whole batch; None:
                not at all.
            member: Which batch members the residuals are of, shape (b,); None: all.

        Returns:
            z [mm], shape (n, 3, b), and y [N] along each active node's directions, shape (b, a); see `forces`.
        """
        r = residual.reshape(-1, residual.shape[-1])
        which = torch.arange(r.shape[1], device=r.device) if member is None else member
        scale = self.scale[which]
        y = torch.zeros(len(which), self.rows.most, device=r.device)
        if not any(self.rows.sizes):
            return (self.rest.apply(r) * scale).reshape(residual.shape), y
        number = which.to(torch.int32)

        def forces(moved: torch.Tensor) -> torch.Tensor:
            """Return the constraints' forces on all rows, against their violation v by an unconstrained z."""
            nonlocal y
            v, unit = torch.empty_like(y), torch.ones(self.rows.count, device=r.device)
            self.rows.launch(kernels.along, tuple(v.shape), moved, unit, scale, number, self.rows.data, v)
            if gaps is not None:
                # The first application solves for the gaps to close; later ones keep closed ones closed.
                v -= self.rows.wanted(gaps)[which]
            y = self.solver.times(v, which)
            total = torch.zeros(self.rows.count, len(which), device=r.device)
            self.rows.launch(kernels.onto_rows, tuple(y.shape), y, number, self.rows.data, total, total)
            return total

        z = self.rest.held(r, self.rows.used[:, which], forces) * scale
        return z.reshape(residual.shape), y

    def forces(self, y: torch.Tensor) -> list[torch.Tensor]:
        """Return the normal forces of `apply`'s y [N], of the whole batch, by contact, shape (s, b), else 0."""
        return self.rows.normal_forces(y)


def compliance_solver(device: str) -> FactoredCompliance | InvertedCompliance:
    """Return the solver of the compliance for a device."""
    # Triangular solves are sequential and slow on a GPU; an inverse is one batched product there (0007).
    return FactoredCompliance() if device == "cpu" else InvertedCompliance()
