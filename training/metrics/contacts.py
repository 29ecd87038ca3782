"""Several contacts in one depth map: where each is, which are missed and which are invented.

Two indenters near each other make one region above any threshold, but two hills of depth. A contact is therefore a
hill: a local maximum that rises above the pass to the next deeper one (its prominence, as of mountains), with the
pixels whose way uphill ends there. Hills are found by flooding from the deepest pixel down, as in a watershed
(L. Vincent, P. Soille, IEEE Trans. Pattern Anal. 13 (1991) 583). Predicted and labelled contacts are matched one to
one with the least sum of distances (H. W. Kuhn, Naval Research Logistics 2 (1955) 83).

A prediction is smoother than the pressed shape. The pass between near contacts is filled in, and the top of a wide one
has dents. The region's outline distinguishes these: two contacts make it long. So in a long region a low hill counts
already, in a round one only a high one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label as connected
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD

PROMINENCE = 0.15
"""Least prominence of a hill of a label, over its own depth [1]."""
LEAST_PROMINENCE = 0.03
"""Least prominence of a hill of a label [mm]: below, noise makes hills."""
LONG = 1.4
"""Elongation from which a predicted region is long [1]: two equal discs reach it a radius apart, one shape seldom."""
PREDICTED_PROMINENCE, ROUND_PROMINENCE = 0.05, 0.4
"""Least prominence of a predicted hill in a long and in a round region, over its own depth [1]."""
PREDICTED_LEAST = 0.02
"""Least prominence of a predicted hill [mm]."""
REACH = 2.0
"""Farthest apart that a predicted and a labelled contact may lie to be the same [mm]."""


@dataclass(frozen=True)
class ContactMatch:
    """The contacts of one frame in label and prediction."""

    labelled: np.ndarray
    """Centroids in the label [px], shape (k, 2), the deepest contact first."""
    predicted: np.ndarray
    """Centroids in the prediction [px], shape (m, 2)."""
    error: np.ndarray
    """Distance to the matched predicted contact [px], shape (k,); NaN where the contact is missed."""

    @property
    def missed(self) -> int:
        """Labelled contacts without a predicted one."""
        return int(np.isnan(self.error).sum())

    @property
    def invented(self) -> int:
        """Predicted contacts without a labelled one."""
        return len(self.predicted) - len(self.labelled) + self.missed

    @property
    def apart(self) -> float:
        """Least distance between two labelled contacts [px]; infinite if there are not two."""
        if len(self.labelled) < 2:
            return np.inf
        distance = cdist(self.labelled, self.labelled)
        return float(distance[np.triu_indices(len(distance), 1)].min())


def match(prediction: np.ndarray, label: np.ndarray, pitch: float) -> ContactMatch:
    """Match the contacts of one frame.

    Args:
        prediction: Predicted depth [mm], shape (pixels_x, pixels_y).
        label: Labelled depth [mm], same shape.
        pitch: Distance of pixels [mm].

    Example:
        >>> import numpy as np
        >>> from tacdata.training.metrics.contacts import match
        >>> x = np.arange(35)[:, None] - np.array([12, 22])  # px: two balls 4 mm apart
        >>> y = np.arange(26) - 13
        >>> label = np.max(0.8 - 0.02 * (x[:, :, None] ** 2 + y**2), axis=1).clip(0)  # mm
        >>> found = match(np.roll(label, 1, axis=0), label, pitch=0.4)
        >>> len(found.labelled), found.missed, found.invented, found.error.round(2).tolist()
        (2, 0, 0, [1.0, 1.0])
    """
    ours, theirs = predicted_centroids(prediction), centroids(label)
    error = np.full(len(theirs), np.nan)
    if len(ours) and len(theirs):
        distance = cdist(theirs, ours)
        # A pair that is too far apart costs more than all others, so that it is matched last.
        far = distance > REACH / pitch
        rows, columns = linear_sum_assignment(np.where(far, 1e6, distance))
        near = ~far[rows, columns]
        error[rows[near]] = distance[rows, columns][near]
    return ContactMatch(theirs, ours, error)


def centroids(depth: np.ndarray) -> np.ndarray:
    """Return the depth-weighted centroid of each contact of a label [px], shape (k, 2), the deepest first.

    Args:
        depth: Depth map [mm], shape (pixels_x, pixels_y).
    """
    return _centroids(depth, hills(depth))


def predicted_centroids(depth: np.ndarray) -> np.ndarray:
    """Return the depth-weighted centroid of each contact of a prediction [px], shape (k, 2), the deepest first.

    Args:
        depth: Predicted depth map [mm], shape (pixels_x, pixels_y).
    """
    owner = hills(depth, prominence=PREDICTED_PROMINENCE, smallest_prominence=PREDICTED_LEAST)
    if owner.max(initial=-1) < 1:
        return _centroids(depth, owner)
    high = hills(depth, prominence=ROUND_PROMINENCE)
    region = np.zeros(owner.shape, np.int64)
    connected(owner >= 0, np.ones((3, 3)), output=region)
    for number in range(1, int(region.max()) + 1):
        inside = region == number
        # In a round region two nearby tops are one contact with noise; in a long one they may be two.
        if elongation(depth, inside) < LONG:
            owner[inside] = owner.max() + 1 + high[inside]
    return _centroids(depth, owner)


def elongation(depth: np.ndarray, inside: np.ndarray) -> float:
    """Return how much longer than wide a region is [1], by the second moments of its depth.

    Args:
        depth: Depth map [mm], shape (pixels_x, pixels_y).
        inside: Pixels of the region [bool], same shape.
    """
    places = np.array(np.nonzero(inside), float)
    # A pixel is a square, which has a moment of its own.
    moments = np.cov(places, aweights=depth[inside], ddof=0) + np.eye(2) / 12
    short, long = np.linalg.eigvalsh(moments)
    return float(np.sqrt(long / short))


def _centroids(depth: np.ndarray, owner: np.ndarray) -> np.ndarray:
    i, j = np.nonzero(owner >= 0)
    where, weight = owner[i, j], depth[i, j].astype(np.float64)
    labels, where = np.unique(where, return_inverse=True)
    top = np.zeros(len(labels))
    np.maximum.at(top, where, weight)
    moments = np.column_stack([np.bincount(where, weight * axis, len(labels)) for axis in (i, j)])
    return (moments / np.bincount(where, weight, len(labels))[:, None])[np.argsort(-top, kind="stable")]


def hills(
    depth: np.ndarray,
    threshold: float = CONTACT_THRESHOLD,
    prominence: float = PROMINENCE,
    smallest_prominence: float = LEAST_PROMINENCE,
) -> np.ndarray:
    """Return which hill each pixel deeper than the threshold belongs to, the deepest hill is 0; -1 elsewhere.

    Args:
        depth: Depth map [mm], shape (pixels_x, pixels_y).
        threshold: Depth above which a pixel belongs to a contact [mm].
        prominence: Least prominence over the hill's own depth [1].
        smallest_prominence: Least prominence [mm].
    """
    rows, columns = depth.shape
    # A border around the map, so that every pixel has eight neighbours.
    owner = np.full((rows + 2) * (columns + 2), -1)
    padded = np.pad(depth, 1).reshape(-1)
    order = np.flatnonzero(padded > threshold)
    # Flooding from the deepest pixel outwards: each pixel joins a hill, and where two hills meet their prominence is
    # known.
    order = order[np.argsort(-padded[order], kind="stable")]
    width = columns + 2
    around = (-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1)
    tops: list[float] = []
    joined: list[int] = []  # hill -> hill that it is a shoulder of; itself if separate

    def standing(hill: int) -> int:
        while joined[hill] != hill:
            hill = joined[hill]
        return hill

    flooded, values = owner.tolist(), padded.tolist()
    for pixel in order.tolist():
        height = values[pixel]
        higher = [pixel + step for step in around if flooded[pixel + step] >= 0]
        if not higher:
            flooded[pixel] = len(tops)
            joined.append(len(tops))
            tops.append(height)
            continue
        flooded[pixel] = flooded[max(higher, key=values.__getitem__)]
        neighbours = {standing(flooded[neighbour]) for neighbour in higher}
        highest = min(neighbours)  # hills are numbered from the deepest
        for hill in neighbours - {highest}:
            if tops[hill] - height < max(prominence * tops[hill], smallest_prominence):
                joined[hill] = highest
    assigned = np.array([standing(hill) if hill >= 0 else -1 for hill in flooded])
    _, numbered = np.unique(np.append(assigned, -1), return_inverse=True)
    return (numbered[:-1] - 1).reshape(rows + 2, width)[1:-1, 1:-1]
