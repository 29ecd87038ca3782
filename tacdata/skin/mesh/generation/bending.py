"""A flat pad bent to its curvature."""

from __future__ import annotations

import numpy as np

from tacdata.sensor import Skin


def bend(skin: Skin, nodes: np.ndarray) -> np.ndarray:
    """Return nodes of the flat pad [mm], shape (n, 3), in the curved one; the outer face keeps its places in plan.

    With a bent underside, a point at depth d below the outer face goes to depth d along the normal there. With a flat
    one, heights above z = 0 shrink in proportion to the thickness left, and protrusions stay as they are.
    """
    if not skin.curved:
        return nodes
    x, y, z = nodes.T
    top = skin.outer_height(x, y)
    if skin.underside == "flat":
        return np.column_stack([x, y, np.where(z > 0, z * top / skin.thickness, z)])
    below = (skin.thickness - z)[:, None]
    return np.column_stack([x, y, top]) - below * skin.outer_normal(x, y)
