"""The rest state's compliance seen from the contact faces: how nodes that may touch move under unit forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from tacdata.skin.contact import Contact
from tacdata.skin.preconditioner import RestFactor


@dataclass(frozen=True)
class Compliance:
    """Columns of K0^-1 for the candidate degrees of freedom of one press."""

    dofs: torch.Tensor
    """Candidate degrees of freedom (3 node + axis), shape (m,), int64."""
    response: torch.Tensor
    """Displacement of every degree of freedom per unit force on a candidate [mm/N], shape (m, 3n), float32."""
    matrix: torch.Tensor
    """The same at the candidates themselves [mm/N], shape (m, m), float64, symmetric."""

    @classmethod
    def of(cls, factor: RestFactor, nodes: int, dofs: np.ndarray) -> Compliance:
        """Solve for the columns of candidate degrees of freedom, shape (m,), in blocks."""
        size = 3 * nodes
        response = torch.empty(len(dofs), size, dtype=torch.float32)
        block = 64
        for start in range(0, len(dofs), block):
            part = dofs[start : start + block]
            unit = torch.zeros(len(part), size, dtype=torch.float64)
            unit[torch.arange(len(part)), torch.as_tensor(part)] = 1.0
            response[start : start + block] = factor.apply(unit.reshape(len(part), nodes, 3)).reshape(len(part), -1)
        index = torch.as_tensor(dofs)
        return cls(index, response, _symmetric(response[:, index].double()))

    def join(self, other: Compliance) -> Compliance:
        """Return the compliance of both sets of candidates together; they must not overlap."""
        dofs = torch.cat([self.dofs, other.dofs])
        response = torch.cat([self.response, other.response])
        return Compliance(dofs, response, _symmetric(response[:, dofs].double()))


def _symmetric(matrix: torch.Tensor) -> torch.Tensor:
    return (matrix + matrix.T) / 2


class ContactPreconditioner:
    """Inverse of K0 plus the present contact stiffness S on the candidates, by the Woodbury identity.

    (K0 + C S C^T)^-1 = K0^-1 - W (I + S G)^-1 S W^T with W = K0^-1 C and G = C^T W. Stiff contact, which K0 alone knows
    nothing of, then costs no conjugate-gradient iterations.
    """

    def __init__(self, factor: RestFactor, compliance: Compliance, nodes: int) -> None:
        """Bind the factor of K0 and the compliance of one press."""
        self._factor, self._compliance = factor, compliance
        self._place = torch.full((3 * nodes,), len(compliance.dofs), dtype=torch.int64)
        self._place[compliance.dofs] = torch.arange(len(compliance.dofs))
        self._slots: dict[int, torch.Tensor] = {}
        self._kept = self._active = torch.empty(0, dtype=torch.int64)
        self._within = torch.empty(0, dtype=torch.int64)
        self._stiffness = self._factors = self._pivots = self._response = torch.empty(0)

    def update(self, contacts: list[Contact]) -> None:
        """Take the contact stiffness that was evaluated last."""
        m = len(self._compliance.dofs)
        stiffness = torch.zeros(m + 1, m + 1, dtype=torch.float64)
        for contact in contacts:
            faces = (contact.pressure[0] > 0).any(dim=1).nonzero().squeeze(1)
            if len(faces):
                blocks = contact.face_stiffness(faces)
                slots = self._face_slots(contact)[faces]
                rows, columns = slots[:, :, None].expand(-1, 18, 18), slots[:, None, :].expand(-1, 18, 18)
                stiffness.index_put_((rows, columns), blocks, accumulate=True)
        active = stiffness[:m, :m].diagonal().nonzero().squeeze(1)
        self._stiffness = stiffness[active][:, active]
        compliance = self._compliance.matrix[active][:, active]
        system = torch.eye(len(active), dtype=torch.float64) + self._stiffness @ compliance
        self._factors, self._pivots = torch.linalg.lu_factor(system)
        self._active = self._compliance.dofs[active]
        self._keep(active)

    def _keep(self, active: torch.Tensor) -> None:
        """Hold the responses of the active candidates; copied anew only when one is missing, as that costs a solve."""
        known = torch.isin(active, self._kept)
        if not bool(known.all()):
            self._kept = torch.unique(torch.cat([self._kept, active]))
            self._response = self._compliance.response[self._kept]
        self._within = torch.searchsorted(self._kept, active)

    def _face_slots(self, contact: Contact) -> torch.Tensor:
        if id(contact) not in self._slots:
            dofs = (3 * contact.faces.long()[:, :, None] + torch.arange(3)).reshape(len(contact.faces), 18)
            self._slots[id(contact)] = self._place[dofs]
        return self._slots[id(contact)]

    def apply(self, residual: torch.Tensor) -> torch.Tensor:
        """Return the approximate solution for one residual of shape (1, n, 3)."""
        z = self._factor.apply(residual)
        if len(self._active):
            y = self._stiffness @ z.reshape(-1)[self._active]
            y = torch.linalg.lu_solve(self._factors, self._pivots, y[:, None])[:, 0]
            load = torch.zeros(len(self._kept), dtype=torch.float32)
            load[self._within] = y.float()
            z = z - (load @ self._response).double().reshape(z.shape)
        return z
