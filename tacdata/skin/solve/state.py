"""What is read off an equilibrium: forces, what the taxels feel, displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from tacdata.skin.contact.contact import Contact
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.solve.batch import Members


@dataclass(frozen=True)
class State:
    """One equilibrium."""

    displacement: np.ndarray
    """Nodal displacements [mm], shape (nodes, 3); empty where not asked for."""
    force: np.ndarray
    """Force of the skin on the indenter [N], shape (3,)."""
    taxel_force: np.ndarray
    """Normal force on each protrusion [N], shape (taxels,)."""
    taxel_closure: np.ndarray
    """Mean downward displacement of each protrusion's rim [mm], shape (taxels,)."""
    taxel_area: np.ndarray
    """Area of each protrusion in contact with the board, undeformed [mm^2], shape (taxels,)."""
    residual: float
    """Out-of-balance force over the contact force [1]."""
    penetration: float
    """Largest penetration [mm]."""
    newton: int
    """Newton iterations since the state before."""


class Gauge:
    """Reads states off a batch."""

    def __init__(self, mesh: SkinMesh, taxels: int, device: str) -> None:
        """Prepare sums over ``taxels`` protrusions."""
        self._taxels = taxels
        self._taxel = torch.as_tensor(mesh.protrusion_taxel, device=device).long()
        faces = mesh.protrusions
        taxel = np.repeat(mesh.protrusion_taxel, faces.shape[1])
        pairs = np.unique(np.stack([faces.ravel(), taxel]), axis=1)
        node, taxel = pairs[:, np.abs(mesh.nodes[pairs[0], 2]) < 1e-9]
        share = 1 / np.maximum(np.bincount(taxel, minlength=taxels), 1)[taxel]
        self._rim = torch.zeros(taxels, len(mesh.nodes), dtype=torch.float64)
        self._rim[torch.as_tensor(taxel).long(), torch.as_tensor(node).long()] = torch.as_tensor(share)
        self._rim = self._rim.to(device)

    def closure(self, u: torch.Tensor) -> torch.Tensor:
        """Return the mean downward displacement of each protrusion's rim [mm], shape (taxels, k); ``u``: (n, 3, k)."""
        return -self._rim @ u[:, 2]

    def states(self, members: Members, contacts: list[Contact], with_displacement: bool) -> list[State]:
        """Return the states of some members of the batch as last evaluated."""
        column = members.column
        force = -contacts[0].force[:, column]
        load = torch.zeros(self._taxels, len(column), dtype=torch.float64, device=force.device)
        area = torch.zeros_like(load)
        if len(contacts) > 1:
            board = contacts[1]
            pressure, weights = board.pressure[:, :, column], board.weights[:, :, None]
            load.index_add_(0, self._taxel, (pressure * weights).sum(dim=1))
            area.index_add_(0, self._taxel, ((pressure > 0) * weights).sum(dim=1))
        force, load, area, closure = (
            value.T.cpu().numpy() for value in (force, load, area, self.closure(members.u))
        )
        nothing = np.empty((0, 3))
        u = members.u.permute(2, 0, 1).cpu().numpy() if with_displacement else [nothing] * len(column)
        return [
            State(
                u[k], force[k], load[k], closure[k], area[k], float(members.error[k]), float(members.penetration[k]),
                members.spent[k],
            )
            for k in range(len(column))
        ]
