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
    """The prepared operator, one for each member; a member that was never put answers nothing."""

    def put(self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor) -> None:
        """Prepare (I + S G)^-1 S of some members anew.

        Args:
            member: Their columns, shape (g,), int64.
            stiffness: S [N/mm], symmetric, positive semidefinite, shape (g, m, m), float32.
            compliance: G [mm/N], symmetric, positive definite, shape (g, m, m), float32.
        """
        ...

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return contact forces [N] against displacements [mm] of the free body; both of shape (b, m), float32.

        ``m`` is at least that of every member; entries beyond a member's own get 0.
        """
        ...


def contact_transfer(batch: int, device: str) -> Transfer:
    """Return the operator for ``batch`` members on "cpu" or a card."""
    return FactoredTransfer(batch) if device == "cpu" else DenseTransfer(batch, device)


class FactoredTransfer:
    """LU factors of I + S G in double precision: it is badly conditioned where a trial state lies deep in the shape."""

    def __init__(self, batch: int) -> None:
        """Prepare for so many members."""
        self._parts: list[tuple[sp.csr_matrix, tuple] | None] = [None] * batch

    def put(self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor) -> None:
        """Factorize, as `Transfer`."""
        for column, s, g in zip(
            member.tolist(), stiffness.double().numpy(), compliance.double().numpy(), strict=True
        ):
            self._parts[column] = None
            if not len(g):
                continue
            # Nodes that share no face are not coupled: a row of S has some sixty entries, however large m.
            sparse = sp.csr_matrix(s)
            system = sparse @ g
            system.flat[:: len(g) + 1] += 1.0
            self._parts[column] = sparse, scipy.linalg.lu_factor(system, overwrite_a=True, check_finite=False)

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces, as `Transfer`."""
        result = torch.zeros_like(displacement)
        for row, part in enumerate(self._parts):
            if part is not None:
                sparse, factors = part
                own = slice(0, len(factors[0]))
                z = displacement[row, own].double().numpy()
                result[row, own] = torch.as_tensor(
                    scipy.linalg.lu_solve(factors, sparse @ z, check_finite=False), dtype=result.dtype
                )
        return result


class DenseTransfer:
    """P - P (P + S)^-1 P with P = G^-1: all that is inverted is symmetric and positive, so no pivoting is needed."""

    _BLOCK = 64

    def __init__(self, batch: int, device: str = "cpu") -> None:
        """Prepare for so many members."""
        self._matrix = torch.zeros(batch, 0, 0, dtype=torch.float32, device=device)

    def put(self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor) -> None:
        """Invert, as `Transfer`."""
        size = stiffness.shape[1]
        self._matrix = self._matrix.to(stiffness.dtype)
        if size > self._matrix.shape[1]:
            more = -(-size // self._BLOCK) * self._BLOCK - self._matrix.shape[1]
            self._matrix = torch.nn.functional.pad(self._matrix, (0, more, 0, more))
        self._matrix[member] = 0.0
        held = inverse(compliance)
        self._matrix[member, :size, :size] = torch.baddbmm(held, held, inverse(held + stiffness) @ held, alpha=-1.0)

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces, as `Transfer`."""
        size = self._matrix.shape[1]
        own = torch.nn.functional.pad(displacement, (0, max(size - displacement.shape[1], 0)))[:, :size]
        forces = (self._matrix @ own[:, :, None])[:, :, 0]
        wide = torch.nn.functional.pad(forces, (0, max(displacement.shape[1] - size, 0)))
        return wide[:, : displacement.shape[1]]
