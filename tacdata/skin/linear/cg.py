"""Preconditioned conjugate gradients for many systems at once, each with a matrix of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch

Field = Callable[[torch.Tensor], torch.Tensor]
"""From fields (n, 3, b) to fields (n, 3, b)."""


@dataclass(frozen=True)
class Stopping:
    """When conjugate gradients end."""

    tolerance: float
    """Preconditioned norm of the residual over that of the right-hand side [1], each member for itself."""
    limit: int
    """Iterations at most."""
    stragglers: float = 0.0
    """Share of the batch that is cut short after ``long`` iterations, rather than let all wait [1]."""
    long: int = 8
    """See ``stragglers``."""

    def enough(self, iteration: int, left: int, wanted: int) -> bool:
        """Return whether to end after an iteration, with ``left`` of the ``wanted`` members not done."""
        return not left or (iteration >= self.long and left <= int(self.stragglers * wanted))


def conjugate_gradients(
    product: Field, precondition: Field, rhs: torch.Tensor, stopping: Stopping
) -> tuple[torch.Tensor, int]:
    """Solve A x = rhs for every batch member; each stops by itself.

    Hestenes and Stiefel, J. Res. Natl. Bur. Stand. 49 (1952) 409. A member whose A turns out indefinite keeps what it
    has, or the preconditioned right-hand side if it has nothing.

    Args:
        product: A times fields.
        precondition: Approximate inverse of A, symmetric and positive definite.
        rhs: Right-hand sides, shape (n, 3, b); a member of zeros is not solved for.
        stopping: When to end.

    Returns:
        x, shape (n, 3, b), and the number of iterations.
    """
    x, r = torch.zeros_like(rhs), rhs
    z = precondition(r)
    p = z.clone()
    rho = _dot(r, z)
    goal = rho * stopping.tolerance**2
    going = rho > 0
    iteration, wanted = 0, int(going.sum())
    for iteration in range(1, stopping.limit + 1):
        q = product(p)
        curvature = _dot(p, q)
        if iteration == 1:
            x = torch.where(going & (curvature <= 0), z, x)
        going = going & (curvature > 0)
        alpha = torch.where(going, rho / curvature, 0.0)
        x.addcmul_(p, alpha)
        r = r - alpha * q
        z = precondition(r)
        rho_new = _dot(r, z)
        going = going & (rho_new > goal)
        if stopping.enough(iteration, int(going.sum()), wanted):
            break
        p = z + torch.where(going, rho_new / rho, 0.0) * p
        rho = rho_new
    return x, iteration


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a * b).flatten(0, 1).sum(dim=0)
