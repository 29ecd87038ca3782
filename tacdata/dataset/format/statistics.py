"""Statistics of an episode and of a dataset, in the shapes that LeRobot expects."""

import numpy as np

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

STATISTICS = ("min", "max", "mean", "std", *QUANTILES)

Statistics = dict[str, np.ndarray]
"""min, max, mean, std, q01 ... q99 of one column in its unit, and count [frames]; float64."""


def column_statistics(values: np.ndarray) -> Statistics:
    """Return the statistics of one column.

    A vector has one entry a component, shape (k,); a scalar shape (1,); an image one for its channel over all
    pixels, shape (1, 1, 1). Every frame and pixel counts (LeRobot samples images); quantiles are exact.

    Args:
        values: Column, shape (n,), (n, k) or (n, height, width).
    """
    shape = {1: (1,), 2: values.shape[1:], 3: (1, 1, 1)}[values.ndim]
    table = values.reshape(len(values), -1) if values.ndim == 2 else values.reshape(-1, 1)
    # Maps stay float32: as float64 a long dataset would need twice the memory.
    table = table.astype(np.float64) if values.dtype != np.float32 else table
    # Sorted once for all quantiles.
    ordered = np.sort(table, axis=0)
    result = {
        "min": ordered[0],
        "max": ordered[-1],
        "mean": table.mean(axis=0, dtype=np.float64),
        "std": table.std(axis=0, dtype=np.float64),
        **{name: _quantile(ordered, q) for name, q in QUANTILES.items()},
    }
    result = {name: value.astype(np.float64).reshape(shape) for name, value in result.items()}
    return {**result, "count": np.array([len(values)])}


def _quantile(ordered: np.ndarray, q: float) -> np.ndarray:
    """Return the linearly interpolated quantile along axis 0 of sorted values (numpy's default)."""
    place = q * (len(ordered) - 1)
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    a, b = ordered[low].astype(np.float64), ordered[high].astype(np.float64)
    return a + (place - low) * (b - a)


def merge(parts: list[Statistics]) -> Statistics:
    """Return the statistics of the frames of all parts together.

    min, max, mean, std and count are exact. The quantiles are LeRobot's: averages of the parts' quantiles
    weighted by their frames, which are not the quantiles of the whole; take those from the data.
    """
    counts = np.array([int(part["count"][0]) for part in parts], dtype=np.float64)
    weights = counts / counts.sum()

    def average(values: list[np.ndarray]) -> np.ndarray:
        return np.tensordot(weights, np.stack(values), axes=1)

    mean = average([part["mean"] for part in parts])
    # Law of total variance: the spread within the parts and that of their means.
    variance = average([part["std"] ** 2 + (part["mean"] - mean) ** 2 for part in parts])
    return {
        "min": np.min([part["min"] for part in parts], axis=0),
        "max": np.max([part["max"] for part in parts], axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        **{name: average([part[name] for part in parts]) for name in QUANTILES},
        "count": np.array([int(counts.sum())]),
    }
