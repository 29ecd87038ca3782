"""Newton's method with preconditioned conjugate gradients for a batch of states of one mesh.

Members do not touch each other: each has its own step length, tolerance and history, and one that fails takes none of
its neighbours along.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch

from tacdata.skin.contact.contact import Contact, ContactState
from tacdata.skin.elasticity.body import Elasticity
from tacdata.skin.linear.contact_preconditioner import ContactPreconditioner
from tacdata.skin.linear.cuda_cg import CardGradients
from tacdata.skin.member.conditions import Conditions
from tacdata.skin.member.pose import Pose

_LEAST_VOLUME = 0.1
"""Volume ratio det F below which a Newton step is shortened [1]."""

_NEAR = 0.1
"""Relative residual below which the tangent of friction replaces its secant [1]."""

_STRAGGLERS, _LONG = 0.3, 8
"""Share of a batch whose linear solves are cut short after so many iterations, rather than let all wait: they take one
more Newton step."""

_WORK = torch.float32
"""Precision of the linear solves; residuals are in double."""


@dataclass(frozen=True)
class SolverSettings:
    """When an equilibrium counts as found."""

    residual: float = 5e-4
    """Out-of-balance force over the largest contact force, Euclidean norms over the nodes [1]."""
    penetration: float = 3e-3
    """Largest |gap| of a point that carries load over the indentation depth [1]."""
    mean_penetration: float = 3e-4
    """Mean |gap|, weighted by the load that points carry, over the indentation depth [1]; the force is off by about one
    and a half times as much."""
    forcing: float = 0.1
    """Relative tolerance of the conjugate gradients in a Newton iteration [1]; loose, as an evaluation costs one."""
    newton_limit: int = 60
    """Newton iterations per state before giving up."""
    patience: int = 12
    """Newton iterations without progress after which a state is given up, so that the path can try a smaller step."""
    cg_limit: int = 400
    """Conjugate-gradient iterations per Newton iteration."""


@dataclass
class Balance:
    """The forces at the present displacements, one entry a member."""

    residual: torch.Tensor
    """Out-of-balance forces on free nodes [N], shape (n, 3, b)."""
    size: torch.Tensor
    """Their Euclidean norm [N], shape (b,)."""
    error: torch.Tensor
    """The same over that of the contact forces [1], shape (b,)."""
    volume: torch.Tensor
    """Smallest det F [1], shape (b,)."""
    penetration: torch.Tensor
    """Largest |gap| of points that carry load [mm], shape (b,)."""
    mean_penetration: torch.Tensor
    """The same, its mean weighted by the load [mm], shape (b,): of the contact where it is largest."""


class Newton:
    """One body and its contacts."""

    def __init__(
        self, body: Elasticity, contacts: list[Contact], fixed: torch.Tensor, preconditioner: ContactPreconditioner,
        settings: SolverSettings,
    ) -> None:
        """Bind the parts; ``fixed`` marks held nodes, shape (n,), bool."""
        self.body, self.contacts, self.preconditioner, self.settings = body, contacts, preconditioner, settings
        self._free = (~fixed).to(torch.float64)[:, None, None]
        self._free_work = self._free.to(_WORK)
        self._card = None if fixed.device.type == "cpu" else CardGradients(body, contacts, preconditioner)

    def balance(
        self, u: torch.Tensor, poses: list[Pose], states: list[ContactState], conditions: Conditions
    ) -> Balance:
        """Evaluate forces at ``u`` [mm], shape (n, 3, b)."""
        internal, volume = self.body.internal_force(u, conditions)
        external = torch.zeros_like(u)
        for contact, pose, state in zip(self.contacts, poses, states, strict=True):
            contact.add_force(u, pose, state, conditions, external)
        # Without contact there is no force to compare with: E times a tenth of a millimetre squared stands in.
        scale = torch.linalg.vector_norm(external, dim=(0, 1)).maximum(0.01 * conditions.modulus)
        residual = (external - internal) * self._free
        size = torch.linalg.vector_norm(residual, dim=(0, 1))
        largest, mean = zip(*(contact.misfit() for contact in self.contacts), strict=True)
        penetration, mean = torch.stack(largest).amax(dim=0), torch.stack(mean).amax(dim=0)
        return Balance(residual, size, size / scale, volume, penetration, mean)

    def rebalance(
        self, now: Balance, u: torch.Tensor, poses: list[Pose], states: list[ContactState], conditions: Conditions,
        which: torch.Tensor,
    ) -> Balance:
        """Evaluate anew where something has changed.

        Args:
            now: What was evaluated last; it may be changed.
            u: Displacements [mm], shape (n, 3, b).
            poses: Of the contacts' shapes.
            states: Of the contacts.
            conditions: Of all members.
            which: Members of which something has changed, by index, shape (k,).

        Returns:
            The forces of all members.
        """
        if self._card is None or 2 * len(which) > u.shape[2]:
            return self.balance(u, poses, states, conditions)
        everyone, few = self.contacts, [pose.take(which) for pose in poses]
        self.contacts = [contact.twin(pose, which) for contact, pose in zip(everyone, few, strict=True)]
        try:
            part = self.balance(
                u.index_select(-1, which), few, [state.take(which) for state in states], conditions.take(which)
            )
            for contact, twin in zip(everyone, self.contacts, strict=True):
                contact.join(twin, which)
        finally:
            self.contacts = everyone
        for field in fields(now):
            getattr(now, field.name).index_copy_(-1, which, getattr(part, field.name))
        return now

    def sharpen(self, error: torch.Tensor) -> None:
        """Choose friction's stiffness for the next evaluation: the tangent only where Newton's method is at home."""
        for contact in self.contacts:
            contact.sharp = (error < _NEAR).to(torch.float64)

    def is_bad(self, before: torch.Tensor, now: Balance) -> torch.Tensor:
        """Return which members' step went astray, shape (b,): residual grown beyond twice, or an element inverted."""
        return ~(now.size <= 2.0 * before) | ~(now.volume >= _LEAST_VOLUME)

    def step(
        self, u: torch.Tensor, residual: torch.Tensor, conditions: Conditions, wanted: torch.Tensor
    ) -> tuple[torch.Tensor, int]:
        """Solve K(u) x = r at the state last evaluated.

        Args:
            u: Displacements [mm], shape (n, 3, b).
            residual: r [N], shape (n, 3, b).
            conditions: Of the members.
            wanted: Members to solve for, shape (b,), bool; others get 0.

        Returns:
            x [mm], shape (n, 3, b), float64, and the number of iterations.
        """
        self.preconditioner.update(conditions.modulus)
        size = torch.linalg.vector_norm(residual, dim=(0, 1)).clamp_min(1e-30)
        r = torch.where(wanted, residual / size, 0.0).to(_WORK)
        u, conditions, tolerance = u.to(_WORK), conditions.to(_WORK), self.settings.forcing
        if self._card:
            limit = self.settings.cg_limit
            x, used = self._card.solve(u, r, conditions, wanted, tolerance, limit, _STRAGGLERS, _LONG)
        else:
            x, used = self._conjugate_gradients(u, r, conditions, tolerance)
        return x.to(torch.float64) * size, used

    def product(self, u: torch.Tensor, p: torch.Tensor, conditions: Conditions) -> torch.Tensor:
        """Return the tangent times ``p`` [N] on free nodes, shape (n, 3, b), at the state last evaluated."""
        result = torch.zeros_like(p)
        self.body.tangent_product(u, p, conditions, result)
        for contact in self.contacts:
            contact.add_product(p, result)
        return result * (self._free_work if p.dtype == _WORK else self._free)

    def _conjugate_gradients(
        self, u: torch.Tensor, r: torch.Tensor, conditions: Conditions, tolerance: float
    ) -> tuple[torch.Tensor, int]:
        """Solve to a relative tolerance in the preconditioned norm; members stop by themselves.

        A member whose tangent turns out indefinite keeps what it has, or the preconditioned residual if it has
        nothing.
        """
        x = torch.zeros_like(r)
        z = self.preconditioner.apply(r)
        p = z.clone()
        rho = _dot(r, z)
        goal = rho * tolerance**2
        going = rho > 0
        iteration, patient = 0, int(_STRAGGLERS * int(going.sum()))
        for iteration in range(1, self.settings.cg_limit + 1):
            q = self.product(u, p, conditions)
            curvature = _dot(p, q)
            if iteration == 1:
                x = torch.where(going & (curvature <= 0), z, x)
            going = going & (curvature > 0)
            alpha = torch.where(going, rho / curvature, 0.0)
            x.addcmul_(p, alpha)
            r = r - alpha * q
            z = self.preconditioner.apply(r)
            rho_new = _dot(r, z)
            going = going & (rho_new > goal)
            left = int(going.sum())
            if not left or (iteration >= _LONG and left <= patient):
                break
            p = z + torch.where(going, rho_new / rho, 0.0) * p
            rho = rho_new
        return x, iteration


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a * b).flatten(0, 1).sum(dim=0)
