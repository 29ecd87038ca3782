"""Searches images for tags in a process of its own.

A search takes tens of milliseconds of computing. In the recorder's process it would delay the reading of the serial
lines, and the clocks are fitted to those arrival times.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

Detect = Callable[..., Future]
"""``detect(image, intrinsics, cube, hint)`` -> a future of the pose or None; with a fingers document instead of a cube,
of a view with ``tips``, ``cubes`` (the next hint) and ``remarks`` (`tacdata.tags.look`)."""
NICENESS = 10
"""Niceness of the process (Unix)."""


@contextmanager
def in_background(detect: Callable[..., Any]) -> Iterator[Detect]:
    """Run a detector in a process of its own while the context lasts.

    Args:
        detect: A function at a module's top level, as `tacdata.tags.look`.
    """
    # Not a fork: it would copy locks that the recorder's threads may hold.
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_give_way)
    try:
        yield lambda *arguments: pool.submit(detect, *arguments)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _give_way() -> None:
    # Ctrl-C reaches every process of the terminal; only the recorder answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    import cv2

    cv2.setNumThreads(1)  # the other cores belong to the streams
