"""The content of a portrait's file: one function, ``portrait(noun) -> Figure``; and the parts that portraits share.

A file ``viewers/portraits/my_noun.py`` draws the class ``MyNoun``, which derives from `tacdata.display.Displayed`.
"""

from collections.abc import Sequence, Set

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tacdata.plans import Press
from tacdata.sensor import DepthMap

SIZE = 9.0, 3.4
"""Width and height of a portrait [inch]."""


def figure(width: float = SIZE[0], height: float = SIZE[1]) -> Figure:
    """Return an empty figure; it belongs to no window."""
    return Figure(figsize=(width, height), layout="constrained")


def depth_map(axes: Axes, depth: np.ndarray, title: str, grid: DepthMap | None = None) -> None:
    """Draw a depth map [mm], shape (pixels_x, pixels_y), x to the right and y up; in pixels without a grid."""
    half = 0.5 * (grid.pixel_pitch if grid else 1.0)
    x, y = (grid.x, grid.y) if grid else (np.arange(depth.shape[0]), np.arange(depth.shape[1]))
    ends = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    image = axes.imshow(depth.T, origin="lower", extent=ends, cmap="viridis", interpolation="nearest")
    axes.figure.colorbar(image, ax=axes, label="depth [mm]", shrink=0.85)
    unit = "mm" if grid else "pixel"
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", title=title)


def sites(axes: Axes, presses: Sequence[Press], open_ones: Set[int] = frozenset()) -> None:
    """Draw the sites of presses, coloured by depth [mm]; open circles are those of some indices."""
    if presses:
        x, y, depth = np.array([(press.x, press.y, press.depth) for press in presses]).T
        points = axes.scatter(x, y, c=depth, cmap="viridis", zorder=2)
        axes.figure.colorbar(points, ax=axes, label="depth [mm]")
        colors = points.to_rgba(depth)
        hollow = [press.index in open_ones for press in presses]
        points.set(array=None, edgecolors=colors, facecolors=np.where(np.c_[hollow], 0.0, colors))
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")


def curves(axes: Axes, seconds: np.ndarray, values: np.ndarray, label: str) -> None:
    """Draw quantities over time [s], shape (n,) and (n, k)."""
    axes.plot(seconds, values, linewidth=0.8)
    axes.set(xlabel="time [s]", ylabel=label)
    axes.spines[["top", "right"]].set_visible(False)
