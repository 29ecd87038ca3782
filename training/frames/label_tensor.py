"""Labels as a tensor: in memory where they fit, else where they lie."""

from __future__ import annotations

import os
import warnings

import numpy as np
import torch


def label_tensor(depth: np.ndarray, place: torch.device) -> torch.Tensor:
    """Return the labels [mm], (n, pixels_x, pixels_y): on the GPU or in memory if they fit, else where they lie."""
    if place.type == "cpu" and depth.nbytes < _free_memory() // 4:
        # Read through once in order, instead of page by page in the order of the first epoch.
        depth = np.array(depth)
    with warnings.catch_warnings():
        # A read-only memory map must not be copied into memory; nothing here writes to it.
        warnings.filterwarnings("ignore", message="The given NumPy array is not writable")
        labels = torch.from_numpy(depth)
    if place.type == "cuda" and depth.nbytes < torch.cuda.mem_get_info(place)[0] // 2:
        return labels.to(place)
    return labels


def _free_memory() -> int:
    """Return the memory that is free [bytes]; 0 where the system does not say."""
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return 0
