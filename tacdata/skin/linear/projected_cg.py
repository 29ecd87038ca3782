"""Conjugate gradients projected onto contact constraints, for many systems at once.

    K x = r + B^T p,   B x = c

Gould, Hribar and Nocedal, SIAM J. Sci. Comput. 23 (2001) 1376. The constraint preconditioner makes a first x with
B x = c; every direction after it has B p = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch

from tacdata.skin.linear.constraint_preconditioner import ConstraintPreconditioner
from tacdata.skin.linear.tangent import Linearization

Product = Callable[[Linearization, torch.Tensor], torch.Tensor]
"""K at a state of some members, times fields of as many, shape (n, 3, b)."""


@dataclass(frozen=True)
class Stopping:
    """When conjugate gradients end."""

    tolerance: float
    """Preconditioned norm of the residual over the energy norm of the first x [1], each member for itself."""
    limit: int
    """Iterations at most."""
    stragglers: float = 0.0
    """Share of the batch that is cut short after ``long`` iterations, rather than let all wait [1]."""
    long: int = 8
    """See ``stragglers``."""

    def enough(self, iteration: int, remaining: int, columns: int) -> bool:
        """Return whether to end after an iteration, with ``remaining`` of the ``columns`` members not done."""
        return not remaining or (iteration >= self.long and remaining <= int(self.stragglers * columns))


def projected_conjugate_gradients(
    product: Product,
    at: Linearization,
    preconditioner: ConstraintPreconditioner,
    rhs: torch.Tensor,
    gaps: Sequence[torch.Tensor],
    mask: torch.Tensor,
    stopping: Stopping,
) -> tuple[torch.Tensor, torch.Tensor, int]:
    """Solve for every batch member that is wanted; each stops by itself, and costs nothing from then on.

    Args:
        product: K times fields.
        at: The state of K.
        preconditioner: Prepared for the present constraints.
        rhs: r, shape (n, 3, b), float32.
        gaps: c, by contact, shape (s, b).
        mask: Members to solve for, shape (b,), bool; others get 0.
        stopping: When to end.

    Returns:
        x, shape (n, 3, b), -p as `ConstraintPreconditioner.forces` takes it, and the number of iterations.
    """
    answer, forces = torch.zeros_like(rhs), torch.zeros(rhs.shape[2], preconditioner.rows.most, device=rhs.device)
    member, iteration = mask.nonzero()[:, 0], 0
    count = len(member)
    if not count:
        return answer, forces, iteration
    at, r = at.take(member), rhs.index_select(2, member)
    x, y = preconditioner.apply(r, gaps, member)
    q = product(at, x)
    # The energy of the first projected step is the scale of what is to be solved.
    goal, r = _dot(x, q).clamp_min(0.0) * stopping.tolerance**2, r - q
    z, y = preconditioner.apply(r, None, member)
    p, rho = z, _dot(r, z)
    going = rho > goal
    for iteration in range(1, stopping.limit):
        remaining = int(going.sum())
        if remaining < len(member):
            answer[:, :, member], forces[member] = x, y
            # Members that are done leave the batch, so that the others' products get cheaper.
            at, (member, x, r, p, y, rho, goal) = _chosen(at, going, (member, x, r, p, y.T, rho, goal))
            y = y.T
        if stopping.enough(iteration, remaining, count):
            break
        q = product(at, p)
        curvature = _dot(p, q)
        # Near an instability the tangent may be indefinite: the member then keeps the x of the step before (0013).
        going = curvature > 0
        alpha = torch.where(going, rho / curvature, 0.0)
        x = x.addcmul(p, alpha)
        r = r - alpha * q
        z, y = preconditioner.apply(r, None, member)
        rho_new = _dot(r, z)
        going = going & (rho_new > goal)
        p = z + rho_new / rho * p
        rho = rho_new
    answer[:, :, member], forces[member] = x, y
    return answer, forces, iteration


def _chosen(
    at: Linearization, mask: torch.Tensor, values: Sequence[torch.Tensor]
) -> tuple[Linearization, list[torch.Tensor]]:
    """Return the members in ``mask``."""
    which = mask.nonzero()[:, 0]
    return at.take(which), [value.index_select(-1, which) for value in values]


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a.reshape(-1, a.shape[-1]) * b.reshape(-1, b.shape[-1])).sum(dim=0)
