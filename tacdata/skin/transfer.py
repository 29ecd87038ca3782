"""What contact forces answer to displacements of the free body: (I + S G)^-1 S for every member of a batch.

S is the contact stiffness and G the free body's compliance, both on the degrees of freedom that are touched.
"""

from __future__ import annotations

from typing import Protocol

import scipy.linalg
import scipy.sparse as sp
import torch

from tacdata.skin.batched_inverse import inverse


class Transfer(Protocol):
    """The prepared operator."""

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return contact forces [N] against displacements [mm] of the free body; both of shape (b, m), float32."""
        ...


def contact_transfer(stiffness: torch.Tensor, compliance: torch.Tensor) -> Transfer:
    """Prepare (I + S G)^-1 S.

    Args:
        stiffness: S [N/mm], symmetric, positive semidefinite, shape (b, m, m), float32.
        compliance: G [mm/N], symmetric, positive definite, shape (b, m, m), float32.
    """
    return (FactoredTransfer if stiffness.device.type == "cpu" else DenseTransfer)(stiffness, compliance)


class FactoredTransfer:
    """LU factors of I + S G in double precision: it is badly conditioned where a trial state lies deep in the shape."""

    def __init__(self, stiffness: torch.Tensor, compliance: torch.Tensor) -> None:
        """Factorize; arguments as of `contact_transfer`."""
        self._parts = []
        for s, g in zip(stiffness.double().numpy(), compliance.double().numpy(), strict=True):
            # Nodes that share no face are not coupled: a row of S has some sixty entries, however large m.
            sparse = sp.csr_matrix(s)
            system = sparse @ g
            system.flat[:: len(g) + 1] += 1.0
            self._parts.append((sparse, scipy.linalg.lu_factor(system, overwrite_a=True, check_finite=False)))

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces, as `Transfer`."""
        rows = [
            torch.as_tensor(scipy.linalg.lu_solve(factors, sparse @ z, check_finite=False))
            for (sparse, factors), z in zip(self._parts, displacement.double().numpy(), strict=True)
        ]
        return torch.stack(rows).to(displacement.dtype)


class DenseTransfer:
    """P - P (P + S)^-1 P with P = G^-1: all that is inverted is symmetric and positive, so no pivoting is needed."""

    def __init__(self, stiffness: torch.Tensor, compliance: torch.Tensor) -> None:
        """Invert; arguments as of `contact_transfer`."""
        held = inverse(compliance)
        self._matrix = torch.baddbmm(held, held, inverse(held + stiffness) @ held, alpha=-1.0)

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces, as `Transfer`."""
        return (self._matrix @ displacement[:, :, None])[:, :, 0]
