"""Many dense systems of a few hundred rows at once.

By symmetric sweeps in blocks, whose work is matrix products: libraries' batched factorizations are made for much
smaller matrices. Only what is on the diagonal and below it is kept up to date.
"""

from __future__ import annotations

import torch
import warp as wp

from tacdata.skin.handed import handed
from tacdata.skin.pivot_kernel import ROWS, invert_in_place
from tacdata.skin.sweep_kernels import sweep_kernels

_STRIP = 256
"""Columns that are brought up to date by one product: the wider, the more of them are above the diagonal, for nothing."""


def inverse(matrices: torch.Tensor) -> torch.Tensor:
    """Return the inverses of symmetric positive definite matrices, shape (b, m, m)."""
    count, rows, _ = matrices.shape
    a, whole = _room(count, rows, matrices.dtype, matrices.device), torch.empty_like(matrices)
    _launch("widen", a, whole, tuple(a.shape), matrices, rows, a)
    _sweep(a)
    row = torch.arange(count, device=a.device)
    _launch("unfold", a, whole, tuple(whole.shape), a, row, whole)
    return whole


def inverse_of_sum(first: torch.Tensor, second: torch.Tensor, row: torch.Tensor, whole: torch.Tensor) -> None:
    """Compute (first^-1 + second)^-1 in double precision, of symmetric positive definite matrices.

    Args:
        first: Shape (g, m, m).
        second: The same.
        row: Where in ``whole`` each goes, shape (g,), int64.
        whole: Receives the results, shape (b, m or more, same); rows and columns beyond m are left as they are.
    """
    count, rows, _ = first.shape
    a = _room(count, rows, torch.float64, first.device)
    total = torch.empty_like(a)
    _launch("widen", a, first, tuple(a.shape), first, rows, a)
    _sweep(a)
    _launch("unfold_onto", a, second, tuple(a.shape), a, second, rows, total)
    _sweep(total)
    _launch("unfold", total, whole, tuple(first.shape), total, row, whole)


def _sweep(a: torch.Tensor) -> None:
    """Make the lower triangles of matrices, shape (b, s, s), those of their negative inverses."""
    count, size, _ = a.shape
    column = torch.empty(count, size, ROWS, dtype=a.dtype, device=a.device)
    pivot = torch.empty(count, ROWS, ROWS, dtype=a.dtype, device=a.device)
    for start in range(0, size, ROWS):
        end = start + ROWS
        _launch("take", a, a, tuple(column.shape), a, start, end, column, pivot)
        _invert(pivot)
        swept = column @ pivot
        for left in range(0, size, _STRIP):
            right = min(left + _STRIP, size)
            a[:, left:, left:right].baddbmm_(swept[:, left:], column[:, left:right].mT, alpha=-1.0)
        _launch("put", a, a, tuple(column.shape), swept, pivot, start, end, a)


def _invert(pivot: torch.Tensor) -> None:
    """Invert blocks, shape (b, 128, 128), in place."""
    if pivot.is_cuda:
        invert_in_place(pivot)
        return
    unit = torch.eye(ROWS, dtype=pivot.dtype, device=pivot.device).expand(len(pivot), -1, -1)
    root = torch.linalg.solve_triangular(torch.linalg.cholesky_ex(pivot)[0], unit, upper=False)
    torch.matmul(root.mT, root, out=pivot)


def _room(count: int, rows: int, dtype: torch.dtype, device: torch.device) -> torch.Tensor:
    size = -(-rows // ROWS) * ROWS
    return torch.empty(count, size, size, dtype=dtype, device=device)


def _launch(name: str, kept: torch.Tensor, other: torch.Tensor, dim: tuple[int, ...], *values: object) -> None:
    if kept.numel():
        kernel = getattr(sweep_kernels(kept.dtype, other.dtype), name)
        wp.launch(kernel, dim=dim, inputs=[*map(handed, values)], device=str(kept.device))
