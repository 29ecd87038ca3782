"""A sample of the data for a viewer, at a rate that it can take; the recorder never waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

Watch = Callable[[str, int, Any], None]
"""``watch(stream, arrival [ns], value)``; must return at once, and may drop values.

``taxels``: readings, shape (channels,); ``cnc``: machine position [mm]; ``camera NAME``: image."""
RATE = {"taxels": 30.0, "cnc": 10.0, "camera": 5.0}
"""Values shown per second of real time, by kind of stream [Hz]."""


class LiveFeed:
    """Reduces streams to the rate of a viewer."""

    def __init__(self, watch: Watch) -> None:
        """Show to ``watch``; after its first error it is not called again."""
        self._watch: Watch | None = watch
        self._shown: dict[str, float] = {}

    def taxels(self, arrival_ns: int, counts: np.ndarray) -> None:
        """Offer one frame [counts], shape (channels,)."""
        self._offer("taxels", "taxels", arrival_ns, counts)

    def position(self, arrival_ns: int, position: tuple[float, float, float]) -> None:
        """Offer one machine position [mm]."""
        self._offer("cnc", "cnc", arrival_ns, position)

    def image(self, camera: str, arrival_ns: int, image: np.ndarray) -> None:
        """Offer one image, uint8."""
        self._offer("camera", f"camera {camera}", arrival_ns, image)

    def _offer(self, kind: str, stream: str, arrival_ns: int, value: Any) -> None:
        instant = time.monotonic()
        # Samples are dropped, not queued: a slow viewer must cost the recorder nothing.
        if self._watch is None or instant - self._shown.get(stream, 0.0) < 1 / RATE[kind]:
            return
        self._shown[stream] = instant
        try:
            self._watch(stream, arrival_ns, value)
        except Exception:  # any error of a viewer: the recording goes on
            self._watch = None
