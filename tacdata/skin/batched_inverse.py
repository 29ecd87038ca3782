"""Many dense systems of a few hundred rows at once."""

from __future__ import annotations

import torch

_BLOCK = 64


def contact_transfer(stiffness: torch.Tensor, compliance: torch.Tensor) -> torch.Tensor:
    """Return (I + S G)^-1 S, what contact forces answer to displacements of the free body, shape (b, m, m).

    Args:
        stiffness: S [N/mm], symmetric, positive semidefinite, shape (b, m, m), float32.
        compliance: G [mm/N], symmetric, positive definite, shape (b, m, m), float32.
    """
    if stiffness.device.type == "cpu":
        # In double precision: I + S G is badly conditioned where a trial state lies deep in the shape.
        stiff = stiffness.double()
        system = stiff @ compliance.double()
        system.diagonal(dim1=1, dim2=2).add_(1.0)
        return torch.linalg.solve_ex(system, stiff)[0].to(stiffness.dtype)
    # P - P (P + S)^-1 P with P = G^-1: all that is inverted is symmetric and positive, so no pivoting is needed.
    held = inverse(compliance)
    return torch.baddbmm(held, held, inverse(held + stiffness) @ held, alpha=-1.0)


def inverse(matrices: torch.Tensor) -> torch.Tensor:
    """Return the inverses of symmetric positive definite matrices, shape (b, m, m).

    By Gauss-Jordan elimination in blocks, whose work is matrix products: libraries' batched factorizations are made for
    much smaller matrices.
    """
    batch, rows, _ = matrices.shape
    size = -(-rows // _BLOCK) * _BLOCK
    a = torch.zeros(batch, size, size, dtype=matrices.dtype, device=matrices.device)
    a[:, :rows, :rows] = matrices
    a.diagonal(dim1=1, dim2=2)[:, rows:] = 1.0
    unit = torch.eye(_BLOCK, dtype=a.dtype, device=a.device)
    for start in range(0, size, _BLOCK):
        here = slice(start, start + _BLOCK)
        pivot = torch.cholesky_inverse(torch.linalg.cholesky_ex(a[:, here, here])[0])
        column = a[:, :, here].clone()
        column[:, here] = 0.0
        a[:, :, here] = 0.0
        a[:, here, here] = unit
        row = pivot @ a[:, here]
        a[:, here] = row
        a.baddbmm_(column, row, alpha=-1.0)
    return a[:, :rows, :rows]
