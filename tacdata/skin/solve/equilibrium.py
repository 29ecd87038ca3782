"""Results of an equilibrium: forces, loads on the taxels, displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from tacdata.skin.contact.contact_forces import ContactForces
from tacdata.skin.contact.contact_surface import ContactSurface
from tacdata.skin.mesh.skin_mesh import SkinMesh


@dataclass(frozen=True)
class Equilibrium:
    """One equilibrium."""

    displacement: np.ndarray
    """Nodal displacements [mm], shape (nodes, 3); empty where not asked for."""
    traction: np.ndarray
    """Contact traction on the indenter at the nodes of the outer face [MPa], by undeformed area, shape (s, 3); empty
    where displacements are. An adhesive attraction is not in it."""
    board_pressure: np.ndarray
    """Pressure on the board at the nodes of the protrusions [MPa], by undeformed area, shape (s,); empty without a
    board, and where displacements are."""
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
    changed: int
    """Those of them after which contact had another status: a node opened, closed, stuck or slipped."""


@dataclass(frozen=True)
class Equilibria:
    """Columns of the batch that have just reached a state that is wanted."""

    column: torch.Tensor
    """Their indices, shape (k,)."""
    u: torch.Tensor
    """Displacements [mm], shape (n, 3, k)."""
    turn: torch.Tensor
    """Rotation from the indenter's frame to the sensor's [1], shape (3, 3, k)."""
    relative: np.ndarray
    """Out-of-balance force over the contact force [1], shape (k,)."""
    penetration: np.ndarray
    """Largest penetration [mm], shape (k,)."""
    newton: list[int]
    """Newton iterations since the state before, each."""
    changed: list[int]
    """Those of them after which contact had another status."""
    contacts: tuple[ContactForces, ...]
    """Forces of each contact, of all columns of the batch."""


class StateReader:
    """Reads states off a batch."""

    def __init__(self, mesh: SkinMesh, taxels: int, board: ContactSurface | None, device: str) -> None:
        """Prepare sums over the protrusions.

        Args:
            mesh: The skin.
            taxels: Number of protrusions.
            board: The board under them, if any; then the second contact of every batch is with it.
            device: "cpu" or "cuda:0".
        """
        self._taxels, self._board = taxels, board
        faces = mesh.protrusions
        taxel = np.repeat(mesh.protrusion_taxel, faces.shape[1])
        pairs = np.unique(np.stack([faces.ravel(), taxel]), axis=1)
        # Protrusions share no node: each contact node belongs to one of them.
        self._taxel = torch.as_tensor(pairs[1], device=device).long()
        # The closure of a taxel is the mean motion of its rim, where the protrusion meets the slab.
        node, taxel = pairs[:, np.abs(mesh.nodes[pairs[0], 2]) < 1e-9]
        share = 1 / np.maximum(np.bincount(taxel, minlength=taxels), 1)[taxel]
        self._rim = torch.zeros(taxels, len(mesh.nodes), dtype=torch.float64)
        self._rim[torch.as_tensor(taxel).long(), torch.as_tensor(node).long()] = torch.as_tensor(share)
        self._rim = self._rim.to(device)

    def closure(self, u: torch.Tensor) -> torch.Tensor:
        """Return the mean downward displacement of each protrusion's rim [mm], shape (taxels, k); ``u``: (n, 3, k)."""
        return -self._rim @ u[:, 2]

    def taxel_load(self, load: torch.Tensor) -> torch.Tensor:
        """Return the sum over each protrusion of the loads on its nodes, shape (taxels, k); ``load``: (s, k)."""
        total = torch.zeros(self._taxels, load.shape[1], dtype=torch.float64, device=load.device)
        return total.index_add_(0, self._taxel, load)

    def states(self, reached: Equilibria, with_displacement: bool = True) -> list[Equilibrium]:
        """Return the states that columns of a batch have reached, displacements only if they are wanted."""
        column = reached.column
        # Contact computes the force on the skin; results state its reaction on the indenter.
        force = -reached.contacts[0].force[:, column]
        load = torch.zeros(self._taxels, len(column), dtype=torch.float64, device=force.device)
        area = torch.zeros_like(load)
        if self._board:
            pressure, hat = reached.contacts[1].pressure[:, column], self._board.area[:, None]
            load.index_add_(0, self._taxel, pressure * hat)
            area.index_add_(0, self._taxel, (pressure > 0) * hat)
        force, load, area, closure = (value.T.cpu().numpy() for value in (force, load, area, self.closure(reached.u)))
        u = traction = [np.empty((0, 3))] * len(column)
        board = [np.empty(0)] * len(column)
        if with_displacement:
            if self._board:
                board = reached.contacts[1].pressure[:, column].T.cpu().numpy()
            u, traction = (field.permute(2, 0, 1).cpu().numpy() for field in (reached.u, _on_indenter(reached)))
        return [
            Equilibrium(
                u[k],
                traction[k],
                board[k],
                force[k],
                load[k],
                closure[k],
                area[k],
                float(reached.relative[k]),
                float(reached.penetration[k]),
                reached.newton[k],
                reached.changed[k],
            )
            for k in range(len(column))
        ]


def _on_indenter(reached: Equilibria) -> torch.Tensor:
    """Return the contact traction on the indenter, in the sensor's frame [MPa], shape (s, 3, k)."""
    pressed, column = reached.contacts[0], reached.column
    normal = pressed.pressure[:, None, column] * pressed.tangent.normal[:, :, column]
    return -(normal + torch.einsum("ijk,sjk->sik", reached.turn, pressed.shear[:, :, column]))
