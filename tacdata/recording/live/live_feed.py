"""Some of what arrives, for somebody who watches: never more than a viewer can take, and never waited for."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

Watch = Callable[[str, int, Any], None]
"""``watch(stream, arrival [ns], value)``; must return at once, and may drop what it is shown.

``taxels``: readings, shape (channels,); ``cnc``: machine position [mm]; ``camera NAME``: image."""
RATE = {"taxels": 30.0, "cnc": 10.0, "camera": 5.0}
"""Most values shown a second of real time, by kind of stream [Hz]."""


class LiveFeed:
    """Thins streams out before they reach a viewer."""

    def __init__(self, watch: Watch) -> None:
        """Show to ``watch``; it is not asked again once it has failed."""
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
        now = time.monotonic()
        if self._watch is None or now - self._shown.get(stream, 0.0) < 1 / RATE[kind]:
            return
        self._shown[stream] = now
        try:
            self._watch(stream, arrival_ns, value)
        except Exception:  # whatever breaks in a viewer, the recording goes on
            self._watch = None
