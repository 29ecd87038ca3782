"""Warp, started without its word that there is no card: that is no news to whoever works on a CPU."""

from __future__ import annotations

import os
import sys
import tempfile

import warp as wp  # noqa: TID253 - imported by modules of kernels alone

NO_CARD = b"Could not find or load the NVIDIA CUDA driver"
"""Said by Warp's native library, past Python, at every start on a machine without a card."""


def start() -> None:
    """Start Warp; whatever else its native library says is passed on."""
    wp.config.log_level = wp.LOG_ERROR
    if sys.stderr is None:  # a service without one
        wp.init()
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile() as said:
        kept = os.dup(2)
        os.dup2(said.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            said.seek(0)
            lines = [line for line in said.read().splitlines(keepends=True) if NO_CARD not in line]
            os.write(2, b"".join(lines))


start()
