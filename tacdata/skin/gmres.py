"""Generalized minimal residuals for many right-hand sides at once, preconditioned on the right.

Saad and Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856. Every column has its own Krylov space, kept in single
precision; a restart takes the residual anew in double, so that the accuracy is that of the products.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch

Field = Callable[[torch.Tensor], torch.Tensor]
"""From fields (n, 3, b) to fields (n, 3, b)."""


@dataclass(frozen=True)
class Solution:
    """What was found."""

    x: torch.Tensor
    """The solution, shape (n, 3, b), float64."""
    residual: torch.Tensor
    """|rhs - A x| over |rhs| [1], shape (b,); 0 where the right-hand side vanishes."""
    iterations: int
    """Products with the matrix."""


def solve(
    product: Field, precondition: Field, rhs: torch.Tensor, guess: torch.Tensor, tolerance: float, restart: int = 30,
    limit: int = 300,
) -> Solution:
    """Solve A x = rhs column by column.

    Args:
        product: A times a field, float64.
        precondition: Approximate inverse of A, float32.
        rhs: Right-hand sides, shape (n, 3, b), float64.
        guess: Where to start, likewise.
        tolerance: Residual over the right-hand side at which all columns must arrive [1].
        restart: Largest dimension of a Krylov space.
        limit: Products with the matrix before giving up.
    """
    size = _norm(rhs)
    scale = torch.where(size > 0, size, 1.0)
    # A column without right-hand side has the solution 0 whatever the guess.
    x, used = torch.where(size > 0, guess, 0.0), 0
    while True:
        residual = rhs - product(x)
        used += 1
        left = _norm(residual) / scale
        if bool((left <= tolerance).all()) or used >= limit:
            return Solution(x, left, used)
        step, spent = _cycle(product, precondition, residual, tolerance * scale, min(restart, limit - used))
        x, used = x + step, used + spent


def _cycle(
    product: Field, precondition: Field, residual: torch.Tensor, goal: torch.Tensor, most: int
) -> tuple[torch.Tensor, int]:
    """Return the correction from one Krylov space, and how many products it took; ``goal``: shape (b,)."""
    batch, start = residual.shape[2], _norm(residual)
    basis = torch.zeros(most + 1, *residual.shape, dtype=torch.float32, device=residual.device)
    basis[0] = _over(residual, start)
    hessenberg = torch.zeros(batch, most + 1, most, dtype=torch.float64)
    target = torch.zeros(batch, most + 1, 1, dtype=torch.float64)
    target[:, 0, 0] = start.cpu()
    used, weights = 0, torch.zeros(batch, most, 1, dtype=torch.float64)
    for used in range(1, most + 1):
        w = product(precondition(basis[used - 1]).to(torch.float64)).to(torch.float32)
        # Twice, as once leaves the basis skew in single precision.
        for _ in range(2):
            share = torch.einsum("jnib,nib->jb", basis[:used], w)
            w = w - torch.einsum("jnib,jb->nib", basis[:used], share)
            hessenberg[:, :used, used - 1] += share.T.double().cpu()
        length = _norm(w)
        hessenberg[:, used, used - 1] = length.double().cpu()
        basis[used] = _over(w, length)
        matrix = hessenberg[:, : used + 1, :used]
        # Spaces that are exhausted leave the matrix without full rank.
        weights = torch.linalg.lstsq(matrix, target[:, : used + 1], driver="gelsd").solution
        left = torch.linalg.vector_norm(target[:, : used + 1] - matrix @ weights, dim=(1, 2))
        if bool((left <= 0.5 * goal.cpu()).all()):
            break
    found = torch.einsum("jnib,jb->nib", basis[:used], weights[..., 0].T.to(basis))
    return precondition(found).to(torch.float64), used


def _norm(field: torch.Tensor) -> torch.Tensor:
    return torch.linalg.vector_norm(field, dim=(0, 1))


def _over(field: torch.Tensor, size: torch.Tensor) -> torch.Tensor:
    return torch.where(size > 1e-30, field / size.clamp_min(1e-30), 0.0).to(torch.float32)
