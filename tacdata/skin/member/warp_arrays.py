"""Tensors as Warp's kernels take them."""

from typing import Any

import torch
import warp as wp


def handed(value: Any) -> Any:
    """Hand a tensor to a kernel without copying, as it stands; anything else as it is.

    A bare description: making an array of it costs ten times as long, and a launch has up to thirty of them.
    """
    return wp.from_torch(value, return_ctype=True) if isinstance(value, torch.Tensor) else value
