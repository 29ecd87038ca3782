"""Many dense systems of a few hundred rows at once.

By symmetric sweeps in blocks, whose work is matrix products: libraries' batched factorizations are made for much
smaller matrices. Only what is on the diagonal and below it is kept up to date.
"""

from __future__ import annotations

import torch
import warp as wp

from tacdata.skin.linear.pivot_kernel import ROWS, invert_in_place
from tacdata.skin.linear.sweep_kernels import sweep_kernels
from tacdata.skin.member.warp_arrays import argument

_STRIP = 256
"""Columns that are brought up to date by one product: the wider, the more are above the diagonal, for nothing."""


def inverse(matrices: torch.Tensor) -> torch.Tensor:
    """Return the inverses of symmetric positive definite matrices, shape (b, m, m)."""
    count, rows, _ = matrices.shape
    a, whole = _room(count, rows, matrices.dtype, matrices.device), torch.empty_like(matrices)
    _launch("widen", a, whole, tuple(a.shape), matrices, rows, a)
    _sweep(a)
    row = torch.arange(count, device=a.device)
    _launch("unfold", a, whole, tuple(whole.shape), a, row, whole)
    return whole


def inverse_of_sum(
    first: torch.Tensor, second: torch.Tensor, row: torch.Tensor, whole: torch.Tensor, lead: int | None = None,
    reach: int = 0,
) -> None:
    """Compute (first^-1 + second)^-1 in double precision, of symmetric positive definite matrices.

    Args:
        first: Shape (g, m, m).
        second: The same.
        row: Where in ``whole`` each goes, shape (g,), int64.
        whole: Receives the results, shape (b, m or more, same); rows and columns beyond m are left as they are.
        lead: So many rows of ``first`` may be coupled in any way; None: all.
        reach: Its rows that follow are coupled only with others less far from them than this.
    """
    count, rows, _ = first.shape
    a = _room(count, rows, torch.float64, first.device)
    total = torch.empty_like(a)
    _launch("widen", a, first, tuple(a.shape), first, rows, a)
    _sweep(a, lead, reach)
    _launch("unfold_onto", a, second, tuple(a.shape), a, second, rows, total)
    _sweep(total)
    _launch("unfold", total, whole, tuple(first.shape), total, row, whole)


def _sweep(whole: torch.Tensor, lead: int | None = None, reach: int = 0) -> None:
    """Make the lower triangles of matrices, shape (b, s, s), those of their negative inverses.

    ``lead`` and ``reach``: see `inverse_of_sum`; what is not coupled is not looked at.
    """
    count, whole_size, _ = whole.shape
    lead, aside = whole_size if lead is None else lead, _blocks(reach)
    pivot = torch.empty(count, ROWS, ROWS, dtype=whole.dtype, device=whole.device)
    for here in range(0, whole_size, ROWS):
        low, high = max(here - aside, 0), min(here + ROWS + aside, whole_size)
        if here < lead:
            low, high = 0, min(max(high, _blocks(lead + reach)), whole_size)
        a = whole[:, low:high, low:high]
        size, start, end = a.shape[1], here - low, here - low + ROWS
        column = torch.empty(count, size, ROWS, dtype=a.dtype, device=a.device)
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
    return torch.empty(count, _blocks(rows), _blocks(rows), dtype=dtype, device=device)


def _blocks(rows: int) -> int:
    return -(-rows // ROWS) * ROWS


def _launch(name: str, kept: torch.Tensor, other: torch.Tensor, dim: tuple[int, ...], *values: object) -> None:
    if kept.numel():
        kernel = getattr(sweep_kernels(kept.dtype, other.dtype), name)
        wp.launch(kernel, dim=dim, inputs=[*map(argument, values)], device=str(kept.device))
