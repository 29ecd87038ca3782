"""Unknowns on one mesh of a skin, read at the nodes of another: a start for the finer one, not a result."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import torch
from scipy.spatial import KDTree

from tacdata.skin.linear.rest_stiffness import compressed_rows
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.solve.configuration import Unknowns

_NEAREST = 24
"""Elements tried for each node, by the distance of their centers [1]."""


class MeshTransfer:
    """From unknowns on a coarser mesh to those on a finer one."""

    def __init__(self, coarse: SkinMesh, fine: SkinMesh, contacts: int, device: str) -> None:
        """Find every node of the finer mesh in the coarser one.

        Args:
            coarse: The mesh that is read.
            fine: The mesh whose nodes ask.
            contacts: 1 for the outer face alone, 2 with the protrusions.
            device: Of the unknowns.
        """
        self._nodal = compressed_rows(nodal(coarse, fine), device)
        faces = [(coarse.outer, fine.outer), (coarse.protrusions, fine.protrusions)][:contacts]
        self._tractions = tuple(compressed_rows(tractions(a, coarse.nodes, b, fine.nodes), device) for a, b in faces)

    def fine(self, coarse: Unknowns) -> Unknowns:
        """Return unknowns on the finer mesh, float64; ``coarse`` in single precision."""
        nodes, axes, count = coarse.u.shape
        u = (self._nodal @ coarse.u.reshape(nodes, axes * count)).reshape(-1, axes, count)
        pairs = zip(self._tractions, coarse.multipliers, strict=True)
        return Unknowns(u.to(torch.float64), tuple((matrix @ contact).to(torch.float64) for matrix, contact in pairs))


def nodal(coarse: SkinMesh, fine: SkinMesh) -> sp.csr_matrix:
    """Return the matrix from a field at the coarse mesh's nodes to the same at the fine mesh's, shape (n, m).

    Elements are taken as straight-sided; a node outside of all is moved into the nearest.
    """
    inside, element = _located(fine.nodes, coarse.nodes[coarse.tets[:, :4]])
    corners = inside * (2 * inside - 1)
    edges = [4 * inside[:, a] * inside[:, b] for a, b in elements.EDGES]
    return _matrix(np.concatenate([corners, np.stack(edges, axis=1)], axis=1), coarse.tets[element], len(coarse.nodes))


def tractions(coarse: np.ndarray, coarse_nodes: np.ndarray, fine: np.ndarray, fine_nodes: np.ndarray) -> sp.csr_matrix:
    """Return the matrix from tractions at the contact nodes of coarse faces to the same of fine ones, shape (s, r).

    Contact nodes are those of the faces in ascending order. Tractions are linear on the four sub-triangles of a face.

    Args:
        coarse: Quadratic triangles, shape (f, 6).
        coarse_nodes: Nodes of their mesh [mm], shape (m, 3).
        fine: Of the other mesh.
        fine_nodes: Its nodes [mm], shape (n, 3).
    """
    nodes, slots = np.unique(coarse, return_inverse=True)
    inside, face = _located(fine_nodes[np.unique(fine)], coarse_nodes[coarse[:, :3]])
    return _matrix(elements.triangle_hats(inside[:, 1:]), slots.reshape(coarse.shape)[face], len(nodes))


def _located(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return barycentric coordinates [1], none below 0, and the simplex of each point.

    Args:
        points: [mm], shape (p, 3).
        corners: Of simplices with k corners [mm], shape (e, k, 3).
    """
    count = min(_NEAREST, len(corners))
    near = KDTree(corners.mean(axis=1)).query(points, count)[1].reshape(len(points), count)
    first, sides = corners[:, 0], corners[:, 1:] - corners[:, :1]
    # A triangle in space has two sides: its matrix is not square.
    inverse = np.linalg.pinv(sides)
    best, elements, shortest = (
        np.zeros((len(points), corners.shape[1])),
        near[:, 0].copy(),
        np.full(len(points), np.inf),
    )
    for element in near.T:
        coordinates = np.einsum("pi,pik->pk", points - first[element], inverse[element])
        # Points of the finer mesh can lie outside of the coarser one by a chord: they take the nearest place in it.
        inside = np.clip(np.concatenate([1 - coordinates.sum(axis=1, keepdims=True), coordinates], axis=1), 0.0, None)
        inside /= inside.sum(axis=1, keepdims=True)
        away = np.linalg.norm(np.einsum("pk,pki->pi", inside, corners[element]) - points, axis=1)
        closer = away < shortest - 1e-12
        best[closer], elements[closer], shortest[closer] = inside[closer], element[closer], away[closer]
    return best, elements


def _matrix(values: np.ndarray, columns: np.ndarray, count: int) -> sp.csr_matrix:
    rows = np.repeat(np.arange(len(values)), values.shape[1])
    return sp.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(values), count))
