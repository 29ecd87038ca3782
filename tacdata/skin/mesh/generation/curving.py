"""Mid-side nodes onto a curved surface, as far as the elements allow it."""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.skin.mesh import elements
from tacdata.skin.mesh.generation.topology import volumes

_KEEP = 0.2
"""Share of the straight element's Jacobian determinant that a curved one must keep [1]."""


def curve(nodes: np.ndarray, targets: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return ``targets`` positions of nodes [mm], shape (n, 3), with those taken back that would fold an element.

    Args:
        nodes: Straight-sided positions [mm], shape (n, 3).
        targets: The same with mid-side nodes moved.
        tets: Nodes of each tetrahedron, shape (e, 10).

    Raises:
        SolveError: If an element has no volume even with straight sides.
    """
    curved = targets.copy()
    points, _ = elements.tetrahedron_quadrature()
    slopes = elements.tetrahedron_gradients(points)
    straight = np.linalg.det(np.einsum("eai,qaj->eqij", nodes[tets], slopes))
    # A node taken back may fold a neighbouring element, which is then found in the next pass.
    for _ in range(5):
        jacobian = np.einsum("eai,qaj->eqij", curved[tets], slopes)
        bad = np.any(np.linalg.det(jacobian) < _KEEP * straight, axis=1)
        if not bad.any():
            break
        # An element too flat to follow keeps its straight edges; the chord error there is a few micrometres.
        index = np.unique(tets[bad][:, 4:])
        curved[index] = nodes[index]
    size = volumes(curved, tets[:, :4])
    if size.min() <= 0:
        worst = int(size.argmin())
        place = curved[tets[worst, :4]].mean(axis=0).round(2).tolist()
        raise SolveError(
            f"element {worst} at {place} mm is flat after snapping to the surface",
            "positive volumes",
            "choose a smaller element size or envelope in the mesh settings",
        )
    return curved
