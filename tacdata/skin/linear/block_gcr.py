"""Generalized conjugate residuals for many right-hand sides of one matrix, which share one space.

Eisenstat, Elman and Schultz, SIAM J. Numer. Anal. 20 (1983) 345, by blocks: every direction serves every right-hand
side, and those that come later (Parks et al., SIAM J. Sci. Comput. 28 (2006) 1651). The space is kept in single
precision; residuals are recomputed in double precision, so that the accuracy is that of the products.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch

Field = Callable[[torch.Tensor], torch.Tensor]
"""From fields (n, 3, b) to fields (n, 3, b)."""

_INDEPENDENT = 1e-3
"""Least length of a direction, once the others are projected out, over the longest of its block [1]. Shorter ones are
mostly rounding. If they are needed, they come again, longer, in a later block."""

_ENOUGH = 0.5
"""Share of the tolerance to which the error is brought in single precision before the residual is recomputed [1]."""


@dataclass(frozen=True)
class GcrSolution:
    """Result of a solve."""

    x: torch.Tensor
    """The solution, shape (n, 3, b), float64."""
    error: torch.Tensor
    """|M^-1 (rhs - A x)| over |x| [1], shape (b,), M^-1 the preconditioner: about how far x is off. 0 where the
    right-hand side vanishes. (The residual itself is no measure of the error where A has a stiff penalty.)"""
    products: int
    """Products with the matrix."""


class KrylovSpace:
    """Directions z and their images w = A z, these orthonormal; for one matrix."""

    def __init__(self, product: Field, precondition: Field, limit: int = 400) -> None:
        """Bind the matrix.

        Args:
            product: A times fields, float64 or float32, of any number of columns.
            precondition: Approximate inverse of A, float32, likewise.
            limit: Largest number of directions; then the space is emptied.
        """
        self._product, self._precondition, self._most = product, precondition, limit
        self._z = self._w = torch.empty(0)
        self._count = 0
        self._products = 0

    def solve(
        self,
        rhs: torch.Tensor,
        guess: torch.Tensor,
        tolerance: float,
        limit: int = 300,
        weight: torch.Tensor | None = None,
    ) -> GcrSolution:
        """Solve A x = rhs.

        Args:
            rhs: Right-hand sides, shape (n, 3, b), float64.
            guess: Where to start, likewise.
            tolerance: Error at which all must arrive, as `GcrSolution` counts it [1].
            limit: Products with the matrix before giving up.
            weight: Of each solution where they add up, shape (b,): an error counts over the largest of them, as
                weighted; None: over its own.
        """
        nonzero = _norm(rhs) > 0
        # Without a right-hand side the solution is 0 whatever the guess.
        x, began = torch.where(nonzero, guess, 0.0), self._products
        while True:
            residual = rhs - self._times(x)
            size = _norm(residual).clamp_min(1e-300)
            z = self._precondition((residual / size).to(torch.float32))
            error = torch.where(nonzero, _norm(z) * size / _counted(_norm(x), weight).clamp_min(1e-300), 0.0)
            used = self._products - began
            if bool((error <= tolerance).all()) or used >= limit:
                return GcrSolution(x, error, used)
            x = x + self._correction(x, residual / size, size, tolerance, limit - used, weight) * size

    def _times(self, p: torch.Tensor) -> torch.Tensor:
        self._products += 1
        return self._product(p)

    def _correction(
        self,
        x: torch.Tensor,
        residual: torch.Tensor,
        size: torch.Tensor,
        tolerance: float,
        limit: int,
        weight: torch.Tensor | None,
    ) -> torch.Tensor:
        """Return the correction of x over ``size`` that brings the error to the tolerance.

        Directions are added only for right-hand sides that are not there yet.

        Args:
            x: Present solution, shape (n, 3, b).
            residual: Of unit length, shape (n, 3, b).
            size: Lengths of the residuals, shape (b,).
            tolerance: As of `solve` [1].
            limit: Products at most.
            weight: As of `solve`.
        """
        shape, extent = residual.shape, _norm(x) / size
        remainder = residual.to(torch.float32).reshape(-1, shape[2])
        solution = torch.zeros_like(remainder)
        columns = torch.arange(shape[2], device=remainder.device)
        for _ in range(limit):
            start = self._count
            # Directions of earlier blocks come first: they cost no product with the matrix.
            if start:
                # The stored products are orthonormal, so a projection gives the best part of the solution in their
                # span.
                share = self._w[:start] @ remainder
                solution += self._z[:start].T @ share
                remainder = remainder - self._w[:start].T @ share
            norms = torch.linalg.vector_norm(remainder[:, columns], dim=0).clamp_min(1e-30)
            z = self._precondition((remainder[:, columns] / norms).reshape(*shape[:2], -1))
            reached = _counted(torch.linalg.vector_norm(solution, dim=0).maximum(extent) * size, weight) / size
            still = _norm(z) * norms > _ENOUGH * tolerance * reached[columns]
            columns = columns[still]
            if not len(columns):
                break
            self._extend(z[:, :, still])
            # No independent direction is left in single precision: `solve` recomputes the residual in double.
            if self._count == start:
                break
        return solution.to(torch.float64).reshape(shape)

    def _extend(self, z: torch.Tensor) -> None:
        """Add directions, shape (n, 3, c)."""
        w = self._times(z).to(torch.float32).reshape(-1, z.shape[2])
        z = z.reshape(w.shape)
        longest = torch.linalg.vector_norm(w, dim=0).max()
        # Twice, as once leaves the space skew in single precision.
        for _ in range(2):
            if self._count:
                share = self._w[: self._count] @ w
                w = w - self._w[: self._count].T @ share
                # Each operation on w is repeated on z, so that w = A z holds.
                z = z - self._z[: self._count].T @ share
            # By eigenvalues, not by Gram and Schmidt: new directions of one block may be nearly the same.
            squares, turn = torch.linalg.eigh((w.T @ w).to(torch.float64))
            independent = squares > (_INDEPENDENT * longest) ** 2
            mix = (turn[:, independent] / squares[independent].sqrt()).to(torch.float32)
            w, z, longest = w @ mix, z @ mix, torch.ones_like(longest)
        self._append(z.T, w.T)

    def _append(self, z: torch.Tensor, w: torch.Tensor) -> None:
        more = len(w)
        # A full space is begun again rather than thinned: what it gave is in the solution already.
        if not len(self._w) or self._count + more > self._most:
            self._z = torch.empty(self._most, w.shape[1], dtype=torch.float32, device=w.device)
            self._w, self._count = torch.empty_like(self._z), 0
        rows = slice(self._count, self._count + more)
        self._z[rows], self._w[rows] = z, w
        self._count += more


def _counted(length: torch.Tensor, weight: torch.Tensor | None) -> torch.Tensor:
    """Return the lengths that errors count over: each, or the largest as weighted."""
    return length if weight is None else (length * weight).max() / weight


def _norm(field: torch.Tensor) -> torch.Tensor:
    return torch.linalg.vector_norm(field, dim=(0, 1))
