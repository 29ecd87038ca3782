"""Which degrees of freedom contact couples with each other: those of one connected part of its faces."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from tacdata.skin.mesh.skin_mesh import SkinMesh


def parts(faces: np.ndarray, count: int) -> np.ndarray:
    """Return the connected part that each point belongs to, shape (count,).

    Args:
        faces: Points of each face, shape (f, k).
        count: Number of points.
    """
    ends = np.broadcast_to(faces[:, :1], faces.shape)
    graph = sp.coo_matrix((np.ones(faces.size), (ends.ravel(), faces.ravel())), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def in_order(loadable: np.ndarray, mesh: SkinMesh) -> np.ndarray:
    """Return degrees of freedom (3 node + axis) in an order that keeps parts together: the outer face's come first.

    On a GPU contact shares are the cheaper the nearer coupled ones stand. On the CPU they are sparse anyway.

    Args:
        loadable: What to order, shape (m,).
        mesh: Whose.
    """
    node = loadable // 3
    part = np.where(np.isin(node, mesh.outer), -1, parts(mesh.protrusions, len(mesh.nodes))[node])
    return loadable[np.lexsort((loadable, part))]


def coupling(numbers: list[np.ndarray], count: int) -> tuple[int, int]:
    """Return how far apart coupled degrees of freedom stand.

    Args:
        numbers: For each contact, the numbers of each face's degrees of freedom, shape (f, 18); ``count`` is none.
        count: Number of degrees of freedom.

    Returns:
        How many, from the first on, may all be coupled with each other; and a distance. Those that follow are coupled
        only with others nearer to them than this distance.
    """
    first = max((int(own[own < count].max(initial=-1)) + 1 for own in numbers[:1]), default=0)
    reach = 0
    for own in numbers[1:]:
        own = np.where(own < count, own, -1)
        own = np.where(own < 0, own.max(axis=1, keepdims=True), own)
        own = own[own[:, 0] >= 0]
        if not len(own):
            continue
        if own.min() < first:
            return count, 0
        part = parts(own, count)[own.min() :]
        place = np.arange(len(part))
        low, high = np.full(part.max() + 1, count), np.zeros(part.max() + 1, dtype=int)
        np.minimum.at(low, part, place)
        np.maximum.at(high, part, place)
        reach = max(reach, int((high - low)[high >= low].max()) + 1)
    return first, reach
