"""Many dense systems of a few hundred rows at once.

By symmetric sweeps in blocks, whose work is matrix products: libraries' batched factorizations are made for much
smaller matrices. Only the lower triangle is kept up to date.
"""

from __future__ import annotations

import torch

from tacdata.skin.linear.sweep_kernels import ROWS, STRIP, invert_in_place, sweep_kernels
from tacdata.skin.member.warp_arrays import argument
from tacdata.warp_runtime import wp

_STRIP = 256
"""Columns that are brought up to date by one product: the wider, the more are above the diagonal, for nothing."""


def inverse_of(matrices: torch.Tensor, row: torch.Tensor, inverse: torch.Tensor) -> None:
    """Invert symmetric positive definite matrices whose size is a multiple of `ROWS`.

    Args:
        matrices: Shape (g, m, m), of which the lower triangle is read; overwritten.
        row: Where in ``inverse`` each goes, shape (g,), int64.
        inverse: Receives the inverses, shape (b, m or more, same); rows and columns beyond m are left as they are.
    """
    _sweep(matrices)
    _launch("unfold", matrices, tuple(matrices.shape), matrices, row, inverse)


def _sweep(a: torch.Tensor) -> None:
    """Make the lower triangles of matrices, shape (g, m, m), those of their negative inverses."""
    count, size, _ = a.shape
    pivot = torch.empty(count, ROWS, ROWS, dtype=a.dtype, device=a.device)
    column = torch.empty(count, size, ROWS, dtype=a.dtype, device=a.device)
    for start in range(0, size, ROWS):
        # The pivot's rows of ``column`` are 0, so the product below leaves them for "put".
        _launch("take", a, tuple(column.shape), a, start, start + ROWS, column, pivot)
        _invert(pivot)
        swept = column @ pivot
        for strip in range(0, size, _STRIP):
            right = min(strip + _STRIP, size)
            a[:, strip:, strip:right].baddbmm_(swept[:, strip:], column[:, strip:right].mT, alpha=-1.0)
        _launch("put", a, tuple(column.shape), swept, pivot, start, start + ROWS, a)


def _invert(pivot: torch.Tensor) -> None:
    """Invert blocks, shape (b, 128, 128), in place."""
    if pivot.is_cuda:
        invert_in_place(pivot)
        return
    unit = torch.eye(ROWS, dtype=pivot.dtype, device=pivot.device).expand(len(pivot), -1, -1)
    root = torch.linalg.solve_triangular(torch.linalg.cholesky_ex(pivot)[0], unit, upper=False)
    torch.matmul(root.mT, root, out=pivot)


def _launch(name: str, matrix: torch.Tensor, shape: tuple[int, ...], *values: object) -> None:
    if matrix.numel():
        kernel, dim = getattr(sweep_kernels(matrix.dtype), name), (shape[0], shape[1] // int(STRIP), shape[2])
        wp.launch(kernel, dim=dim, inputs=[*map(argument, values)], device=str(matrix.device))
