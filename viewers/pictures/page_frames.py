"""A page as the frames of a film: all that stays is drawn once, all that moves in every frame."""

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, FigureBase
from matplotlib.legend import Legend
from matplotlib.spines import Spine


class MovingPage(Protocol):
    """A figure of which some things move with time."""

    figure: Figure

    def show(self, time: Any, /) -> None:
        """Move everything to where it was at a time, in the page's own unit."""


def page_frames(page: MovingPage, times: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a page at given times, in its own unit, uint8, shape (height, width, 3) each."""
    canvas = FigureCanvasAgg(page.figure)
    canvas.draw()
    page.figure.set_layout_engine("none")  # laid out once; every frame is the same
    for time in times.tolist():
        page.show(time)
    moving = _moving(page.figure)
    for artist in moving:
        artist.set_animated(True)  # left out of the next drawing
    canvas.draw()
    background = canvas.copy_from_bbox(page.figure.bbox)
    for time in times.tolist():
        page.show(time)
        canvas.restore_region(background)
        for artist in moving:
            artist.draw(canvas.get_renderer())
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _moving(figure: Figure) -> list[Artist]:
    """Return the artists that have changed since the last drawing, and frames and legends that lie over them."""
    containers = Axes, Axis, FigureBase
    moving: list[Artist] = []
    for place in figure.findobj(lambda artist: isinstance(artist, Axes | FigureBase)):
        parts = [part for part in place.get_children() if not isinstance(part, containers)]
        fixed = [part for part in parts if isinstance(part, Spine | Legend)]
        # An artist is stale from its first change until it is drawn.
        changed = [part for part in parts if part.stale and part not in fixed]
        moving += [*changed, *fixed] if changed else []
    return sorted(moving, key=lambda artist: artist.get_zorder())
