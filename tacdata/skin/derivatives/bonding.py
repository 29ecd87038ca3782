"""Motion of the held faces if their support gives way a little.

A bond of compliance c [mm/MPa] lets a held face move by u = -c t, with t the traction that it exerts on the skin. A
film of glue of thickness h and stiffness M has c = h / M (Goland and Reissner, J. Appl. Mech. 11 (1944) A17). Held
faces are the limit c = 0, and du/dc there is -t. It is found from the nodal reactions: both do the same work on the
faces' shape functions.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import torch
from scipy.sparse.linalg import splu

from tacdata.skin.contact.contact_surface import face_quadrature
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh


def held_faces(mesh: SkinMesh, fixed: np.ndarray) -> np.ndarray:
    """Return the boundary triangles with all nodes held, shape (f, 6); ``fixed``: shape (n,), bool."""
    # A tetrahedron has its mid-edge nodes after the four corners.
    pairs = {frozenset(pair): 4 + number for number, pair in enumerate(elements.EDGES)}
    found = []
    for corners in elements.FACES:
        sides = [pairs[frozenset((corners[a], corners[b]))] for a, b in elements.FACE_EDGES]
        found.append(mesh.tets[:, [*corners, *sides]])
    faces = np.concatenate(found)
    # A face inside the body belongs to two tetrahedra and appears twice.
    _, first, count = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    boundary = faces[first[count == 1]]
    return boundary[fixed[boundary].all(axis=1)]


class Bonding:
    """The held faces of one mesh."""

    def __init__(self, mesh: SkinMesh, fixed: np.ndarray) -> None:
        """Factorize the faces' mass matrix; ``fixed`` marks held nodes, shape (n,), bool."""
        faces = held_faces(mesh, fixed)
        weights, shapes = (
            value.numpy()
            for value in face_quadrature(torch.as_tensor(mesh.nodes), torch.as_tensor(faces.astype(np.int32)), 1)
        )
        local = np.einsum("fk,ka,kb->fab", weights, shapes, shapes)
        self._nodes, place = np.unique(faces, return_inverse=True)
        place, count = place.reshape(faces.shape), len(self._nodes)
        rows, columns = np.repeat(place, 6, axis=1).ravel(), np.tile(place, (1, 6)).ravel()
        # Reactions at nodes are integrals over hats; the mass matrix turns them into tractions.
        mass = sp.csc_matrix(sp.coo_matrix((local.ravel(), (rows, columns)), shape=(count, count)))
        self._solve = splu(mass).solve if count else None

    def slack(self, reaction: torch.Tensor) -> torch.Tensor:
        """Return how far held nodes move per compliance [MPa], the other nodes by 0; shape (n, 3, b).

        Args:
            reaction: Force of the bond on each node [N], shape (n, 3, b), float64.
        """
        result = torch.zeros_like(reaction)
        if self._solve:
            b = reaction.shape[2]
            load = reaction.cpu().numpy()[self._nodes].reshape(len(self._nodes), 3 * b)
            # The bond gives way against the traction that it exerts, u = -c t.
            displacement = -self._solve(np.ascontiguousarray(load)).reshape(len(self._nodes), 3, b)
            result[torch.as_tensor(self._nodes, device=result.device)] = torch.as_tensor(
                displacement, device=result.device
            )
        return result
