"""Tensors as arguments of Warp kernels, without copies."""

from typing import Any

import torch

from tacdata.warp_runtime import wp

REAL = {torch.float32: wp.float32, torch.float64: wp.float64}
"""Warp's name of a scalar type."""


def argument(value: Any) -> Any:
    """Return a tensor as an argument of a kernel; anything else as it is.

    The bare descriptor takes half the time of a `wp.array`, and a step of conjugate gradients has some fifty of them.
    """
    return wp.from_torch(value, return_ctype=True) if isinstance(value, torch.Tensor) else value


def filled(struct: Any, **values: Any) -> Any:
    """Return an instance of a `wp.struct` with its fields set; tensors stay where they are and are kept alive."""
    instance = struct()
    for name, value in values.items():
        setattr(instance, name, wp.from_torch(value) if isinstance(value, torch.Tensor) else value)
    return instance
