"""Numbers that a processor takes together: columns of a row, eight at once."""

from __future__ import annotations

import numpy as np

from tacdata.warp_runtime import wp  # noqa: TID253 - for kernels; imported with them

LANES = 8
"""As many numbers as a processor's widest registers hold [1]."""
Lanes = wp.types.vector(length=LANES, dtype=wp.float64)
"""A row's step takes so many columns."""


def in_lanes(values: np.ndarray) -> wp.array:
    """Return an array (n, k) of Warp's that uses the same memory, `LANES` columns each, shape (n, k / `LANES`)."""
    return wp.array(values.reshape(len(values), -1, LANES), dtype=Lanes, device="cpu", copy=False)


def padded(values: np.ndarray) -> np.ndarray:
    """Return values (..., k) with zeros up to a multiple of `LANES` of them, float64: themselves where they have it."""
    if values.shape[-1] % LANES == 0 and values.dtype == np.float64 and values.flags.c_contiguous:
        return values
    wide = np.zeros((*values.shape[:-1], values.shape[-1] + -values.shape[-1] % LANES))
    wide[..., : values.shape[-1]] = values
    return wide
