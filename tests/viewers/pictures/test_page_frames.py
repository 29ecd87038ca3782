"""Frames of a film are the page as if drawn whole, whatever moves on it."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from tacdata.viewers.pictures.page_frames import page_frames

TIMES = np.array([0.0, 1.0, 2.0, 0.5])


class Page:
    """A curve that grows, a pad in front of a link, a map, a span that appears, and a title."""

    def __init__(self):
        self.figure = Figure(figsize=(4, 3), dpi=60)
        self.figure.set_layout_engine("constrained")
        left, right = self.figure.subplots(1, 2)
        left.set(xlim=(0, 2), ylim=(0, 1), xlabel="time")
        (self._line,) = left.plot([], [])
        self._link = left.add_collection(LineCollection([], colors="0.4", linewidths=4), autolim=False)
        self._pad = left.add_patch(Ellipse((0, 0), 0.3, 0.2, zorder=2.5))
        self._span = left.axvspan(1.0, 2.0, color="red", alpha=0.2, visible=False)
        self._title = left.set_title(" ", loc="left")
        self._map = right.imshow(np.eye(4), vmin=0, vmax=3)
        left.legend([self._line], ["force"], loc="upper left")

    def show(self, time):
        x = np.linspace(0, time, 20)
        self._line.set_data(x, x / 2)
        self._link.set_segments([[(0, 0), (time, 0.6)]])
        self._pad.set_center((time, 0.6))
        self._span.set_visible(time >= 1.5)
        self._title.set_text(f"{time:.1f} s")
        self._map.set_data((1 + time) * np.eye(4))


def test_a_frame_is_the_page_drawn_whole():
    whole, frames = Page(), list(page_frames(Page(), TIMES))
    canvas = FigureCanvasAgg(whole.figure)
    canvas.draw()
    whole.figure.set_layout_engine("none")
    for time, frame in zip(TIMES, frames, strict=True):
        whole.show(time)
        canvas.draw()
        off = np.abs(np.asarray(canvas.buffer_rgba())[..., :3].astype(int) - frame).max(axis=2)
        assert (off > 8).mean() < 0.001
    assert (frames[0] != frames[2]).any() and frames[1].shape == (180, 240, 3)
    assert (frames[3] != frames[0]).mean() == pytest.approx((frames[3] != frames[1]).mean(), abs=0.1)
