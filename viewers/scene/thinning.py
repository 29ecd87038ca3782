"""Which rows of a long recording are drawn: few enough to stay light, chosen so that peaks stay in sight."""

import numpy as np

MAPS, CURVES, ARRAYS, IMAGES = 600, 6000, 3000, 900
"""Most maps and skins, rows of a set of curves, pictures of the taxels, and images of a camera that are drawn."""


IMAGE_BYTES = 24_000_000
"""Most bytes of a camera's images: large ones are fewer, so that the file stays light."""


def strongest(strength: np.ndarray, limit: int) -> np.ndarray:
    """Return the row of the greatest strength in each of ``limit`` stretches of equal length, ascending.

    All rows, where there are no more than ``limit``.

    Args:
        strength: How much there is to see in each row, shape (n,).
        limit: Rows to keep at most.
    """
    if len(strength) <= limit:
        return np.arange(len(strength))
    starts = stretches(len(strength), limit)
    highest = np.maximum.reduceat(strength, starts)
    stretch = np.repeat(np.arange(limit), np.diff(np.append(starts, len(strength))))
    rows = np.flatnonzero(strength == highest[stretch])
    return rows[np.unique(stretch[rows], return_index=True)[1]]


def stretches(count: int, number: int) -> np.ndarray:
    """Return where each of ``number`` stretches of equal length begins among ``count`` rows, shape (number,)."""
    return np.linspace(0, count, number + 1).astype(int)[:-1]


def extremes(values: np.ndarray, limit: int) -> np.ndarray:
    """Return rows that keep the course of curves: the ends of the widest change in each stretch, ascending.

    In each of ``limit / 2`` stretches of equal length the curve that spans the largest part of its own whole range
    decides; its lowest and highest row are kept, and the first and last row of all.

    Args:
        values: Curves, shape (n, curves); NaN where nothing was measured.
        limit: Rows to keep, about.
    """
    count = len(values)
    if count <= limit:
        return np.arange(count)
    # Two rows of each stretch are kept, its highest and its lowest.
    edges = np.linspace(0, count, limit // 2 + 1).astype(int)
    high = np.where(np.isfinite(values), values, -np.inf)
    low = np.where(np.isfinite(values), values, np.inf)
    tops, bottoms = np.maximum.reduceat(high, edges[:-1]), np.minimum.reduceat(low, edges[:-1])
    ranges = np.maximum(tops.max(axis=0) - bottoms.min(axis=0), 1e-300)
    widest = np.argmax(np.nan_to_num((tops - bottoms) / ranges, nan=-1.0, posinf=-1.0, neginf=-1.0), axis=1)
    rows = {0, count - 1}
    for a, b, k in zip(edges[:-1].tolist(), edges[1:].tolist(), widest.tolist(), strict=True):
        rows.add(a + int(np.argmax(high[a:b, k])))
        rows.add(a + int(np.argmin(low[a:b, k])))
    return np.array(sorted(rows))


def evenly(count: int, limit: int) -> np.ndarray:
    """Return rows at equal distance, at most ``limit`` of ``count``, the first and last among them."""
    if count <= limit:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, limit).round().astype(int))
