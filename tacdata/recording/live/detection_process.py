"""Searching images for tags in a process of its own, so that the streams' threads never wait for it.

A search costs tens of milliseconds of computing; in the recorder's process it would hold up the reading of
the serial lines, whose arrival times are what the clocks are fitted to.
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
"""By how much the process gives way to others (Unix)."""


@contextmanager
def in_background(detect: Callable[..., Any]) -> Iterator[Detect]:
    """Run a detector in a process of its own while the context lasts.

    Args:
        detect: A function at a module's top level, as `tacdata.tags.look`.
    """
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_give_way)
    try:
        yield lambda *arguments: pool.submit(detect, *arguments)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _give_way() -> None:
    # Ctrl-C reaches every process of the terminal; only the recorder is to answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    import cv2

    cv2.setNumThreads(1)  # the other cores belong to the streams
