"""Equilibrium of the skin under its contacts: Newton's method with preconditioned conjugate gradients, in batches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import torch

from tacdata.skin.contact import Contact, ContactState
from tacdata.skin.elasticity import Elasticity

_PATIENCE = 12
"""Newton iterations without progress after which a state is given up, so that the path can try a smaller step."""

_LEAST_VOLUME = 0.1
"""Volume ratio det F below which a Newton step is shortened [1]."""

_NEAR = 3e-2
"""Relative residual below which the tangent of friction replaces its secant [1]."""


@dataclass(frozen=True)
class SolverSettings:
    """When an equilibrium counts as found."""

    residual: float = 5e-4
    """Out-of-balance force over the largest contact force, Euclidean norms over the nodes [1]."""
    penetration: float = 5e-3
    """Largest |gap| of a point that carries load over the indentation depth [1]."""
    forcing: float = 0.1
    """Relative tolerance of the conjugate gradients in a Newton iteration [1]; loose, as an evaluation costs one."""
    newton_limit: int = 60
    """Newton iterations per state before giving up."""
    cg_limit: int = 400
    """Conjugate-gradient iterations per Newton iteration."""


class Preconditioner(Protocol):
    """An approximate inverse of the tangent."""

    def update(self, contacts: list[Contact]) -> None:
        """Take the contacts' present stiffness into account."""
        ...

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return the approximate solution for residuals of shape (b, n, 3)."""
        ...


@dataclass
class Outcome:
    """How the search for an equilibrium ended, one entry a batch member."""

    converged: torch.Tensor
    """Shape (b,), bool."""
    residual: torch.Tensor
    """Out-of-balance force over the contact force [1], shape (b,)."""
    penetration: torch.Tensor
    """Largest penetration [mm], shape (b,)."""
    newton: int
    """Newton iterations."""
    cg: int
    """Conjugate-gradient iterations in all."""
    reason: list[str]
    """Why a member did not converge, in words; empty where it did."""


class Equilibrium:
    """Newton's method for one body and its contacts."""

    def __init__(
        self, body: Elasticity, contacts: list[Contact], fixed: torch.Tensor, preconditioner: Preconditioner,
        settings: SolverSettings,
    ) -> None:
        """Bind the parts; ``fixed`` marks held nodes, shape (n,), bool."""
        self.body, self.contacts, self.preconditioner, self.settings = body, contacts, preconditioner, settings
        self.free = (~fixed).to(torch.float64)[None, :, None]

    def residual(
        self, u: torch.Tensor, poses: list[torch.Tensor], states: list[ContactState]
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return out-of-balance forces [N] (b, n, 3) on free nodes, their scale [N] (b,), the smallest J [1] (b,)."""
        internal, ratio = self.body.internal_force(u)
        external = torch.zeros_like(u)
        for contact, pose, state in zip(self.contacts, poses, states, strict=True):
            contact.add_force(u, pose, state, external)
        scale = torch.linalg.norm(external.flatten(1), dim=1)
        return (external - internal) * self.free, scale, ratio

    def product(self, u: torch.Tensor, p: torch.Tensor) -> torch.Tensor:
        """Return the tangent times ``p`` [N] on free nodes, shape (b, n, 3), at the state last evaluated."""
        result = torch.zeros_like(p)
        self.body.tangent_product(u, p, result)
        for contact in self.contacts:
            contact.add_product(p, result)
        return result * self.free

    def solve(
        self, u: torch.Tensor, poses: list[torch.Tensor], states: list[ContactState], depth: torch.Tensor
    ) -> tuple[torch.Tensor, Outcome]:
        """Find the equilibrium at the given poses.

        Args:
            u: Start [mm], shape (b, n, 3).
            poses: Pose of each contact's shape, shape (b, 4).
            states: History of each contact; multipliers are updated, friction history is not (`Contact.accept`).
            depth: Indentation depth [mm], shape (b,), by which penetration is judged.

        Returns:
            Displacements [mm], shape (b, n, 3), and the outcome.
        """
        limit = self.settings
        r, scale, ratio = self.residual(u, poses, states)
        cg_total, newton = 0, 0
        error = self._error(r, scale)
        done = torch.zeros(len(u), dtype=torch.bool, device=u.device)
        best, best_at = float("inf"), 0
        for newton in range(1, limit.newton_limit + 1):
            tight = self._penetration() <= limit.penetration * depth.clamp_min(1e-3)
            done = (error <= limit.residual) & tight
            if bool(done.all()):
                break
            worst = float(error.max())
            if (not worst < 0.9 * best and newton - best_at > _PATIENCE) or not math.isfinite(worst):
                break
            if worst < 0.9 * best:
                best, best_at = worst, newton
            augment = (error <= 20 * limit.residual) & ~tight
            if bool(augment.any()):
                self._augment(states, augment)
                best, best_at = float("inf"), newton
                r, scale, ratio = self.residual(u, poses, states)
                error = self._error(r, scale)
            self._sharpen(float(error.max()))
            step, used = self._cg(u, r, torch.full_like(error, limit.forcing))
            cg_total += used
            u, r, scale, ratio, error = self._advance(u, step, r, poses, states)
        penetration = self._penetration()
        reason = [
            "" if ok else f"after {newton} Newton iterations the residual is {e:.1e} of the contact force "
            f"(allowed {limit.residual:.0e}), penetration {1e3 * p:.1f} um, smallest det F {j:.2f}"
            for ok, e, p, j in zip(done.tolist(), error.tolist(), penetration.tolist(), ratio.tolist(), strict=True)
        ]
        return u, Outcome(done, error, penetration, newton, cg_total, reason)

    def _sharpen(self, error: float) -> None:
        """Choose friction's stiffness for the next evaluation: the tangent only where Newton's method is at home."""
        for contact in self.contacts:
            contact.sharp = 1.0 if error < _NEAR else 0.0

    def _error(self, r: torch.Tensor, scale: torch.Tensor) -> torch.Tensor:
        # Without contact there is no force to compare with: E times a tenth of a millimetre squared stands in.
        floor = 0.01 * self.body.material.youngs_modulus
        return torch.linalg.norm(r.flatten(1), dim=1) / scale.clamp_min(floor)

    def _penetration(self) -> torch.Tensor:
        return torch.stack([contact.misfit() for contact in self.contacts]).amax(dim=0)

    def _augment(self, states: list[ContactState], which: torch.Tensor) -> None:
        for contact, state in zip(self.contacts, states, strict=True):
            state.multiplier[which] = contact.pressure[which]

    def _advance(
        self, u: torch.Tensor, step: torch.Tensor, r: torch.Tensor, poses: list[torch.Tensor],
        states: list[ContactState],
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Take the Newton step, halved for members whose residual would grow much or whose elements would invert."""
        before = torch.linalg.norm(r.flatten(1), dim=1)
        length = torch.ones(len(u), 1, 1, dtype=u.dtype, device=u.device)
        trial, r_new, scale, ratio = u, r, before, before
        for _ in range(8):
            trial = u + length * step
            r_new, scale, ratio = self.residual(trial, poses, states)
            after = torch.linalg.norm(r_new.flatten(1), dim=1)
            bad = ~(after <= 2.0 * before) | ~(ratio >= _LEAST_VOLUME)
            if not bool(bad.any()):
                break
            length[bad] *= 0.5
        return trial, r_new, scale, ratio, self._error(r_new, scale)

    def _cg(self, u: torch.Tensor, r: torch.Tensor, tolerance: torch.Tensor) -> tuple[torch.Tensor, int]:
        """Solve K(u) x = r to a relative tolerance (b,) in the preconditioned norm; members stop by themselves.

        A member whose tangent turns out indefinite keeps what it has, or the preconditioned residual if it has
        nothing.
        """
        x = torch.zeros_like(r)
        self.preconditioner.update(self.contacts)
        z = self.preconditioner.apply(r)
        p = z.clone()
        rho = (r * z).flatten(1).sum(dim=1)
        goal = rho * tolerance**2
        going = rho > 0
        iteration = 0
        for iteration in range(1, self.settings.cg_limit + 1):
            q = self.product(u, p)
            curvature = (p * q).flatten(1).sum(dim=1)
            if iteration == 1:
                x = torch.where((curvature <= 0)[:, None, None], z, x)
            going = going & (curvature > 0)
            alpha = torch.where(going, rho / curvature, torch.zeros_like(rho))[:, None, None]
            x = x + alpha * p
            r = r - alpha * q
            z = self.preconditioner.apply(r)
            rho_new = (r * z).flatten(1).sum(dim=1)
            going = going & (rho_new > goal)
            if not bool(going.any()):
                break
            beta = torch.where(going, rho_new / rho, torch.zeros_like(rho))
            p = z + beta[:, None, None] * p
            rho = rho_new
        return x, iteration
