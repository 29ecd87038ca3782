"""Replays of a grasp or wipe as a film: from the side and from above, one replay beside the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from viewers.output_file import FILMS, new_file
from viewers.pictures.film import MOST, RATE, write_film
from viewers.rerun.replay import BALL, COLORS, PAD, Replay

WIDTH, HEIGHT = 4.2, 6.4
"""Of one replay in a frame [inch]."""
RESOLUTION = 80
"""Dots an inch."""
MARGIN = 25.0
"""Around all that moves [mm]."""


def film_replays(path: Path, replays: Mapping[str, Replay], sizes: tuple[float, ...]) -> None:
    """Write a film of replays, by name.

    Args:
        path: A new file that ends in .mp4 or .gif.
        replays: Name -> replay.
        sizes: Radius of the ball, or half the sizes of the eraser [m]: between the fingers, along the strokes, height.

    Raises:
        UsageError: If the file exists, has another ending, or films of its kind cannot be written here.
    """
    new_file(path, *FILMS)
    rate, longest = RATE[path.suffix], max(float(replay.time[-1]) for replay in replays.values())
    times = np.linspace(0.0, longest, min(max(round(longest * rate), 2), MOST[path.suffix]))
    write_film(path, _frames(replays, sizes, times))


def _frames(replays: Mapping[str, Replay], sizes: tuple[float, ...], times: np.ndarray) -> Iterator[np.ndarray]:
    page = ReplayPage(replays, sizes)
    canvas = FigureCanvasAgg(page.figure)
    canvas.draw()
    page.figure.set_layout_engine("none")  # laid out once; every frame is alike
    for time in times.tolist():
        page.show(time)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


class ReplayPage:
    """All replays at one time: a column each, from the side and from above."""

    def __init__(self, replays: Mapping[str, Replay], sizes: tuple[float, ...]) -> None:
        """Draw the beginning; ``replays`` and ``sizes`` [m] as in `film_replays`."""
        self._replays, self._sizes = replays, 1000 * np.array(sizes)
        ends = _ends(replays, sizes)
        heights = [np.ptp(ends[:, 2]), np.ptp(ends[:, 1])]
        self.figure = Figure(figsize=(WIDTH * len(replays), HEIGHT), dpi=RESOLUTION, layout="constrained")
        self._axes = self.figure.subplots(2, len(replays), squeeze=False, height_ratios=heights)
        self._objects: dict[tuple[str, int], Any] = {}
        self._pads: dict[tuple[str, int], list[Circle]] = {}
        for column, (name, replay) in enumerate(replays.items()):
            for row, up in enumerate((2, 1)):
                axes = self._axes[row, column]
                axes.set(xlim=ends[:, 0], ylim=ends[:, up], ylabel="z [mm]" if up == 2 else "y [mm]", aspect="equal")
                self._add(axes, name, up, replay.tips.shape[1])
            self._axes[1, column].set_xlabel("x [mm]")
        self.show(0.0)

    def _add(self, axes: Any, name: str, up: int, count: int) -> None:
        color, sizes = np.array(BALL) / 255, self._sizes
        shape = Circle((0, 0), sizes[0], color=color)
        if len(sizes) > 1:
            shape = Rectangle((0, 0), 2 * sizes[0], 2 * sizes[up], color=color)
        pads = [
            Circle((0, 0), 1000 * PAD, color=np.array(COLORS[k % len(COLORS)]) / 255, alpha=0.8) for k in range(count)
        ]
        for patch in (shape, *pads):
            axes.add_patch(patch)
        self._objects[name, up], self._pads[name, up] = shape, pads

    def show(self, time: float) -> None:
        """Move everything to where it was at a time since the beginning [s]."""
        for column, (name, replay) in enumerate(self._replays.items()):
            row = min(int(np.searchsorted(replay.time, time)), len(replay.time) - 1)
            ball, tips = 1000 * replay.ball[row], 1000 * replay.tips[row]
            for up in (2, 1):
                shape = self._objects[name, up]
                if isinstance(shape, Circle):
                    shape.center = ball[0], ball[up]
                else:
                    shape.set_xy((ball[0] - self._sizes[0], ball[up] - self._sizes[up]))
                for pad, tip in zip(self._pads[name, up], tips, strict=True):
                    pad.center = tip[0], tip[up]
            height = 1000 * float(replay.ball[row, 2] - replay.ball[0, 2])
            verdict = "held" if replay.held else "lost"
            words = f"{name}: {verdict}\n{time:.1f} s, object at {height:+.0f} mm"
            self._axes[0, column].set_title(words, fontsize=10)


def _ends(replays: Mapping[str, Replay], sizes: tuple[float, ...]) -> np.ndarray:
    """Return least and largest x, y and z of all that moves, with a margin [mm], shape (2, 3)."""
    places = np.concatenate([p.reshape(-1, 3) for replay in replays.values() for p in (replay.ball, replay.tips)])
    reach = MARGIN + 1000 * max(sizes)
    return np.stack([1000 * places.min(axis=0) - reach, 1000 * places.max(axis=0) + reach])
