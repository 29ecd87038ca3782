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

Field = Callable[[torch.Tensor], torch.Tensor]
"""From fields (n, 3, b) to fields (n, 3, b)."""


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

    def enough(self, iteration: int, left: int, wanted: int) -> bool:
        """Return whether to end after an iteration, with ``left`` of the ``wanted`` members not done."""
        return not left or (iteration >= self.long and left <= int(self.stragglers * wanted))


def projected_conjugate_gradients(
    product: Field, preconditioner: ConstraintPreconditioner, rhs: torch.Tensor, gaps: Sequence[torch.Tensor],
    stopping: Stopping,
) -> tuple[torch.Tensor, torch.Tensor, int]:
    """Solve for every batch member; each stops by itself.

    Args:
        product: K times fields.
        preconditioner: Prepared for the present constraints.
        rhs: r, shape (n, 3, b), float32.
        gaps: c, by contact, shape (s, b).
        stopping: When to end.

    Returns:
        x, shape (n, 3, b), -p as `ConstraintPreconditioner.forces` takes it, and the number of iterations.
    """
    x, _ = preconditioner.apply(rhs, gaps)
    q = product(x)
    goal = _dot(x, q).clamp_min(0.0) * stopping.tolerance**2
    r = rhs - q
    z, y = preconditioner.apply(r)
    p = z.clone()
    rho = _dot(r, z)
    going = rho > goal
    iteration, wanted = 1, int(going.sum())
    for iteration in range(2, stopping.limit + 1):
        if stopping.enough(iteration - 1, int(going.sum()), wanted):
            break
        q = product(p)
        curvature = _dot(p, q)
        going = going & (curvature > 0)
        alpha = torch.where(going, rho / curvature, 0.0)
        x.addcmul_(p, alpha)
        r = r - alpha * q
        z, y = preconditioner.apply(r)
        rho_new = _dot(r, z)
        going = going & (rho_new > goal)
        p = z + torch.where(going, rho_new / rho, 0.0) * p
        rho = rho_new
    return x, y, iteration


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a.reshape(-1, a.shape[-1]) * b.reshape(-1, b.shape[-1])).sum(dim=0)
