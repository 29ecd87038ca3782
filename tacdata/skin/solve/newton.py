"""Newton's method with preconditioned conjugate gradients for a batch of states of one mesh.

Members do not touch each other: each has its own step length, tolerance and history, and one that fails takes none of
its neighbours along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.cuda_cg import CudaConjugateGradients
from tacdata.skin.linear.projected_cg import Stopping, projected_conjugate_gradients
from tacdata.skin.linear.rest_stiffness import DenseRest
from tacdata.skin.linear.tangent import Linearization, TangentStiffness
from tacdata.skin.member.columns import Columns
from tacdata.skin.solve.configuration import Configuration
from tacdata.skin.solve.settings import SolverSettings

_LEAST_VOLUME = 0.1
"""Volume ratio det F below which a Newton step is shortened [1]."""

_NEAR, _TANGENT = 0.05, 0.9
"""Relative residual below which the tangent of friction replaces its secant, and its share in the mean of both [1].

By nine tenths of it, nodes settle that would flip between opposite slips: a flat punch's first state takes 9 steps
instead of 19."""

_STRAGGLERS, _LONG = 0.3, 8
"""Share of a batch whose linear solves are cut short after so many iterations, rather than let all wait: they take one
more Newton step."""

_WORK = torch.float32
"""Precision of the linear solves; residuals are in double."""


@dataclass(frozen=True)
class Residual(Columns):
    """How far each batch member is from equilibrium, and its contact forces."""

    force: torch.Tensor
    """Out-of-balance forces on free nodes [N], shape (n, 3, b)."""
    norm: torch.Tensor
    """Their Euclidean norm [N], shape (b,)."""
    relative: torch.Tensor
    """The same over that of the contact forces [1], shape (b,)."""
    volume: torch.Tensor
    """Smallest det F [1], shape (b,)."""
    penetration: torch.Tensor
    """Largest mean |gap| of nodes that carry load, and penetration of others [mm], shape (b,)."""
    mean_penetration: torch.Tensor
    """The same, its mean weighted by the load [mm], shape (b,): of the contact where it is largest."""
    contacts: tuple[ContactForces, ...]
    """Of each contact."""
    scale: torch.Tensor
    """Norm of the contact forces [N], shape (b,)."""


class Newton:
    """Residual and Newton step of one body and its contacts."""

    def __init__(
        self,
        body: Elasticity,
        surfaces: Sequence[ContactSurface],
        fixed: torch.Tensor,
        preconditioner: ConstraintPreconditioner,
        settings: SolverSettings,
    ) -> None:
        """Bind the parts; ``fixed`` marks held nodes, shape (n,), bool."""
        self.body, self.surfaces, self.preconditioner, self.settings = body, tuple(surfaces), preconditioner, settings
        self.tangent = TangentStiffness(body, surfaces)
        self._free = (~fixed).to(torch.float64)[:, None, None]
        self._free_work = self._free.to(_WORK)
        # Falling attraction needs all of it: near a jump the rest would be far too stiff.
        self._tangent = 1.0 if any(surface.attracts for surface in surfaces) else _TANGENT
        cuda = isinstance(preconditioner.rest, DenseRest)
        self._cuda = CudaConjugateGradients(self.tangent, preconditioner) if cuda else None

    def residual(self, at: Configuration) -> Residual:
        """Evaluate the forces of all members."""
        internal, volume = self.body.internal_force(at.u, at.conditions)
        external = torch.zeros_like(at.u)
        contacts = self.add_contact_forces(at, external)
        # Without contact there is no force to compare with: E times a tenth of a millimetre squared replaces it.
        scale = torch.linalg.vector_norm(external, dim=(0, 1)).maximum(0.01 * at.conditions.modulus)
        force = (external - internal) * self._free
        norm = torch.linalg.vector_norm(force, dim=(0, 1))
        gaps = [surface.penetration(forces) for surface, forces in zip(self.surfaces, contacts, strict=True)]
        largest, mean = (torch.stack(values).amax(dim=0) for values in zip(*gaps, strict=True))
        return Residual(force, norm, norm / scale, volume, largest, mean, contacts, scale)

    def add_contact_forces(self, at: Configuration, total: torch.Tensor) -> tuple[ContactForces, ...]:
        """Add the contacts' nodal forces on the skin [N] to ``total``, shape (n, 3, b); return them by contact."""
        return tuple(
            surface.add_forces(at.u, multiplier, pose, history, at.conditions, at.friction_tangent, at.near, total)
            for surface, multiplier, pose, history in zip(
                self.surfaces, at.multipliers, at.poses, at.histories, strict=True
            )
        )

    def updated(self, residual: Residual, at: Configuration, which: torch.Tensor) -> Residual:
        """Return the residual of all members after a change of some, by index, shape (k,).

        Where few have changed, these alone are evaluated, and ``residual`` is changed in place.
        """
        limit = at.u.shape[2] // 2 if self._cuda else at.u.shape[2] - 1
        if len(which) > limit:
            return self.residual(at)
        residual.put(which, self.residual(at.take(which)))
        return residual

    def friction_tangent(self, residual: Residual) -> torch.Tensor:
        """Return the share of friction's tangent, shape (b,): 0, by the secant, for members far from the solution."""
        return self._tangent * (residual.relative < _NEAR).to(torch.float64)

    def is_bad(self, limit: torch.Tensor, residual: Residual) -> torch.Tensor:
        """Return which members' step failed, shape (b,): residual more than doubled, or an element nearly inverted."""
        # Negated comparisons: NaN counts as a failed step.
        return ~(residual.relative <= torch.clamp_min(2.0 * limit, 0.3)) | ~(residual.volume >= _LEAST_VOLUME)

    def step(
        self, at: Configuration, residual: Residual, mask: torch.Tensor
    ) -> tuple[torch.Tensor, tuple[torch.Tensor, ...], int]:
        """Solve Newton's system, loosely: displacements and multipliers move together.

        Args:
            at: Where the tangent is taken.
            residual: The residual there.
            mask: Members to solve for, shape (b,), bool; others get 0.

        Returns:
            Changes of the displacements [mm], shape (n, 3, b), and of each contact's multipliers [MPa], shape (s, b),
            and the number of iterations.
        """
        contacts = [forces.tangent for forces in residual.contacts]
        self.preconditioner.update(contacts, at.conditions.modulus)
        size = residual.scale
        # Right-hand sides of about norm 1, as the GPU's solver rounds to half precision; x is scaled back below.
        r = torch.where(mask, residual.force / size, 0.0).to(_WORK)
        gaps = [torch.where(mask & own.tangent.active, -own.gap / size, 0.0) for own in residual.contacts]
        # Single precision for the products: a step is solved to a tenth only.
        linearization = self.tangent.at(at.u.to(_WORK), at.conditions, contacts, None if self._cuda else mask)
        stopping = Stopping(self.settings.forcing, self.settings.cg_limit, _STRAGGLERS, _LONG)
        if self._cuda:
            x, y, used = self._cuda.solve(linearization, r, gaps, mask, stopping)
        else:
            x, y, used = projected_conjugate_gradients(
                self.product, linearization, self.preconditioner, r, gaps, mask, stopping
            )
        # Inactive multipliers end at 0.
        # The solvers return -p in newtons; multipliers are tractions, hence sign and area.
        changes = tuple(
            torch.where(mask, own.pressure - multiplier - force * size / surface.area[:, None], 0.0)
            for surface, own, multiplier, force in zip(
                self.surfaces, residual.contacts, at.multipliers, self.preconditioner.forces(y), strict=True
            )
        )
        return x.to(torch.float64) * size, changes, used

    def product(self, linearization: Linearization, p: torch.Tensor) -> torch.Tensor:
        """Return the tangent times ``p`` [N] on free nodes, shape (n, 3, b)."""
        result = torch.zeros_like(p)
        self.tangent.add_product(linearization, p, result)
        return result * (self._free_work if p.dtype == _WORK else self._free)
