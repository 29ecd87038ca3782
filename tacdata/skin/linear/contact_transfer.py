"""What contact forces answer to displacements of the free body: (I + S G)^-1 S for every member of a batch.

S is the contact stiffness and G the free body's compliance, both on the degrees of freedom that are touched.
"""

from __future__ import annotations

from typing import Protocol

import scipy.sparse as sp
import torch

from tacdata.skin.linear.batched_inverse import inverse_of_sum


class Transfer(Protocol):
    """The prepared operator, one for each member; a member that was never put answers nothing."""

    def put(
        self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor, lead: int | None = None,
        reach: int = 0,
    ) -> None:
        """Prepare (I + S G)^-1 S of some members anew.

        Args:
            member: Their columns, shape (g,), int64.
            stiffness: S [N/mm], symmetric, positive semidefinite, shape (g, m, m), float32.
            compliance: G [mm/N], symmetric, positive definite, shape (g, m, m), float32.
            lead: So many rows that S may couple with each other in any way; None: all.
            reach: Rows that follow are coupled only with others less far from them than this.
        """
        ...

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return contact forces [N] against displacements [mm] of the free body; both of shape (b, m), float32.

        ``m`` is at least that of every member; entries beyond a member's own get 0.
        """
        ...


def contact_transfer(batch: int, device: str) -> Transfer:
    """Return the operator for ``batch`` members on "cpu" or a GPU."""
    return FactoredTransfer(batch) if device == "cpu" else DenseTransfer(batch, device)


class FactoredTransfer:
    """LU factors of I + S G in double precision: it is badly conditioned where a trial state lies deep in the shape."""

    def __init__(self, batch: int) -> None:
        """Prepare for so many members."""
        self._parts: list[tuple[sp.csr_matrix, tuple[torch.Tensor, torch.Tensor]] | None] = [None] * batch

    def put(
        self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor, lead: int | None = None,
        reach: int = 0,
    ) -> None:
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
            # Through torch, whose library takes a third of the time of scipy's.
            lower_upper, pivots, _ = torch.linalg.lu_factor_ex(torch.from_numpy(system))
            self._parts[column] = sparse, (lower_upper, pivots)

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces of the first members, as `Transfer`."""
        result = torch.zeros_like(displacement)
        for row, part in enumerate(self._parts[: len(displacement)]):
            if part is not None:
                sparse, factors = part
                own = slice(0, len(factors[0]))
                right = torch.from_numpy(sparse @ displacement[row, own].double().numpy())
                result[row, own] = torch.linalg.lu_solve(*factors, right[:, None])[:, 0].to(result.dtype)
        return result


class DenseTransfer:
    """(S^-1 + G)^-1: both that are inverted are symmetric and positive, so no pivoting is needed.

    What is touched but carries no load makes S singular; it is given a stiffness that the body does not feel. Its
    inverse is then large, so all is done in double precision, in which a GPU multiplies matrices as fast as in single.
    """

    _BLOCK = 256
    _FAINT = 1e-3
    """That stiffness, over the body's at the same degree of freedom [1]."""

    def __init__(self, batch: int, device: str = "cpu") -> None:
        """Prepare for so many members."""
        self.matrix = torch.zeros(batch, 0, 0, dtype=torch.float32, device=device)
        """The operator of every member, shape (b, m, m), zero beyond a member's own rows."""

    def put(
        self, member: torch.Tensor, stiffness: torch.Tensor, compliance: torch.Tensor, lead: int | None = None,
        reach: int = 0,
    ) -> None:
        """Invert, as `Transfer`."""
        size = stiffness.shape[1]
        self.matrix = self.matrix.to(stiffness.dtype)
        if size > self.matrix.shape[1]:
            more = -(-size // self._BLOCK) * self._BLOCK - self.matrix.shape[1]
            self.matrix = torch.nn.functional.pad(self.matrix, (0, more, 0, more))
        self.matrix[member] = 0.0
        held = stiffness.clone()
        held.diagonal(dim1=1, dim2=2).add_(self._FAINT / compliance.diagonal(dim1=1, dim2=2))
        inverse_of_sum(held, compliance, member, self.matrix, lead, reach)

    def times(self, displacement: torch.Tensor) -> torch.Tensor:
        """Return the forces of the first members, as `Transfer`."""
        size = self.matrix.shape[1]
        own = torch.nn.functional.pad(displacement, (0, max(size - displacement.shape[1], 0)))[:, :size]
        forces = (self.matrix[: len(own)] @ own[:, :, None])[:, :, 0]
        wide = torch.nn.functional.pad(forces, (0, max(displacement.shape[1] - size, 0)))
        return wide[:, : displacement.shape[1]]
