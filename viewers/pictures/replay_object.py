"""The object of a replay, and its support, from the side or from above."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from tacdata.replay.outcome import ReplayOutcome

COLOR, SUPPORT = (0.70, 0.63, 0.56), "0.88"
"""Colours of the object, unlike those of fingers, and of its support."""


class ReplayObjectShape:
    """The object as a circle or rectangle that moves; it is drawn upright, as if it did not turn."""

    def __init__(self, axes: Axes, replay: ReplayOutcome, up: int) -> None:
        """Draw it at the beginning.

        Args:
            axes: x to the right, and z or y upwards [mm].
            replay: The replay.
            up: Which axis points upwards: 2 for z, seen from the side, 1 for y, seen from above.
        """
        self._path, self._up, body = 1000 * replay.path.centre, up, replay.scene.body
        sizes = 1000 * np.array(body.sizes)
        self._half = (sizes[0], sizes[0]) if len(sizes) == 1 else (sizes[0], sizes[min(up, len(sizes) - 1)])
        is_round = body.geometry == "sphere" or (body.geometry == "cylinder" and up == 1)
        self._shape: Circle | Rectangle
        if is_round:
            self._shape = Circle((0, 0), sizes[0], color=COLOR)
        else:
            self._shape = Rectangle((0, 0), 2 * self._half[0], 2 * self._half[1], color=COLOR)
        low, word = self._path[0, 2] - 1000 * body.height, "board" if replay.scene.task == "wipe" else "table"
        if up == 2:
            axes.axhspan(low - 1000, low, color=SUPPORT, zorder=0)
            axes.text(0.02, low - 3, word, fontsize=7, color="0.3", va="top", transform=axes.get_yaxis_transform())
        else:
            axes.set_facecolor(SUPPORT)
            axes.text(0.02, 0.03, word, fontsize=7, color="0.3", transform=axes.transAxes)
        axes.add_patch(self._shape)

    def show(self, row: int) -> None:
        """Move it to where it was at a row of the replay."""
        x, y = self._path[row, 0], self._path[row, self._up]
        if isinstance(self._shape, Circle):
            self._shape.center = x, y
        else:
            self._shape.set_xy((x - self._half[0], y - self._half[1]))
