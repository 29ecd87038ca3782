"""Starts Warp without its banner and without its warning that there is no GPU; the one place that imports it.

A file of kernels imports ``wp`` from here, as Warp's options are taken when a file's first kernel is declared.
"""

from __future__ import annotations

import os
import sys
import tempfile

import warp as wp  # noqa: TID251
from warp import Function  # noqa: TID251

__all__ = ["Function", "start", "wp"]

NO_GPU = b"Could not find or load the NVIDIA CUDA driver"
"""Printed by Warp's native library, past Python, at every start on a machine without a GPU."""
UNROLLED = 3
"""Passes up to which a kernel's loop is written out, on a machine without a GPU.

Kernels loop over an element's four points, ten nodes and three directions. Written out, as by Warp's 16, such loops run
as fast and take longer to compile, in Python and in LLVM. On an empty cache, `pytest
tests/skin/elasticity/test_skin_elasticity.py` takes 28 s of the processor, and 37 with 6 passes.
"""


def start() -> None:
    """Start Warp; all other output of its native library is passed on."""
    _start_quietly()
    if not wp.is_cuda_available():
        wp.config.max_unroll = UNROLLED


def _start_quietly() -> None:
    wp.config.log_level = wp.LOG_ERROR
    if sys.stderr is None:  # a service without one
        wp.init()
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile() as printed:
        descriptor = os.dup(2)
        os.dup2(printed.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(descriptor, 2)
            os.close(descriptor)
            printed.seek(0)
            lines = [line for line in printed.read().splitlines(keepends=True) if NO_GPU not in line]
            os.write(2, b"".join(lines))


start()
