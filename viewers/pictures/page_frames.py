"""A page drawn again for every frame of a film."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


class MovingPage(Protocol):
    """A figure of which some things move with time."""

    figure: Figure

    def show(self, time: Any, /) -> None:
        """Move everything to where it was at a time, in the page's own unit."""
        ...


def page_frames(page: MovingPage, times: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a page at given times, in its own unit, uint8, shape (height, width, 3) each."""
    canvas = FigureCanvasAgg(page.figure)
    canvas.draw()
    page.figure.set_layout_engine("none")  # laid out once; every frame is the same
    for time in times.tolist():
        page.show(time)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()
