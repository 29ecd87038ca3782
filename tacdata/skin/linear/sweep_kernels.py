# Warp kernels are Python in form only; their operators have no types that pyright knows.
# pyright: reportOperatorIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportReturnType=false, reportAssignmentType=false, reportInvalidTypeForm=false
"""Kernels of `tacdata.skin.linear.batched_inverse`, which keeps of symmetric matrices the lower triangle alone."""

from functools import cache
from types import SimpleNamespace

import torch
import warp as wp

from tacdata.skin.member.warp_arrays import REAL


@cache
def sweep_kernels(dtype: torch.dtype) -> SimpleNamespace:
    """Compile the kernels for matrices of one precision."""
    real = REAL[dtype]

    @wp.kernel(module="unique", enable_backward=False)
    def take(
        a: wp.array3d(dtype=real), start: int, end: int, column: wp.array3d(dtype=real), pivot: wp.array3d(dtype=real)
    ):
        """Read the columns from ``start`` to ``end``, the block on the diagonal apart."""
        b, i, c = wp.tid()
        value = real(0.0)
        if i < start:
            value = a[b, start + c, i]
        elif i < end:
            pivot[b, i - start, c] = a[b, i, start + c]
        else:
            value = a[b, i, start + c]
        column[b, i, c] = value

    @wp.kernel(module="unique", enable_backward=False)
    def put(
        swept: wp.array3d(dtype=real), pivot: wp.array3d(dtype=real), start: int, end: int, a: wp.array3d(dtype=real)
    ):
        """Write what `take` read, swept."""
        b, i, c = wp.tid()
        if i < start:
            a[b, start + c, i] = swept[b, i, c]
        elif i < end:
            a[b, i, start + c] = -pivot[b, i - start, c]
        else:
            a[b, i, start + c] = swept[b, i, c]

    @wp.kernel(module="unique", enable_backward=False)
    def unfold(a: wp.array3d(dtype=real), row: wp.array(dtype=wp.int64), whole: wp.array3d(dtype=real)):
        """Write the inverses, of which the negative lower triangle is known, as rows of ``whole``."""
        b, i, j = wp.tid()
        whole[wp.int32(row[b]), i, j] = -a[b, wp.max(i, j), wp.min(i, j)]

    return SimpleNamespace(take=take, put=put, unfold=unfold)
