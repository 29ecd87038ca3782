"""The skin and the indenter in three dimensions, as a panel of a page."""

from typing import Any

import numpy as np
from matplotlib.figure import SubFigure
from matplotlib.ticker import MaxNLocator
from scipy.spatial.transform import Rotation

from tacdata.viewers.pictures.panels import Moments, mappable, seconds
from tacdata.viewers.scene.moments import nearest
from tacdata.viewers.scene.scene import Scene

BODY_COLOR = 0.55, 0.6, 0.68, 0.3
"""Of the indenter: pale, so that the skin below it shows."""


def skin(figure: SubFigure, scene: Scene, instants: Moments, bar: bool = True) -> None:
    """Draw the skin with the indenter at the deepest moment, with a bar of its colours."""
    surface = scene.surfaces[0]
    moment = dict(instants)["deepest"]
    index, shaded = nearest(surface.time_ns, moment), surface.name != "undeformed"
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False)
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    colors = surface.colors[index].reshape(*x.shape, 3) / 255
    mesh: dict[str, Any] = {
        "rstride": 1,
        "cstride": 1,
        "linewidth": 0.3,
        "edgecolor": (1, 1, 1, 0.25 if shaded else 0.8),
    }
    axes.plot_surface(x, y, surface.height[index], facecolors=colors, shade=False, **mesh)
    low, high = scene.corners
    for level in (low[2], high[2]):
        axes.plot(
            *zip(*[(a, b, level) for a, b in _corners(low, high)], strict=True), color="0.6", linewidth=0.9, zorder=0
        )
    for a, b in _corners(low, high)[:4]:
        axes.plot([a, a], [b, b], [low[2], high[2]], color="0.6", linewidth=0.9, zorder=0)
    top = high[2]
    for body in scene.bodies:
        vertices = Rotation.from_quat(body.quaternion).apply(body.vertices)
        placed = (vertices + body.position[nearest(body.time_ns, moment)]).T
        axes.plot_trisurf(*placed, triangles=body.faces, color=BODY_COLOR, linewidth=0, shade=False, zorder=3)
        top = max(top, float(placed[2].max()))
    axes.set(xlabel="x [mm]", ylabel="y [mm]", xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], top))
    axes.set_zlabel("z [mm]")
    axes.set_box_aspect((high[0] - low[0], high[1] - low[1], top - low[2]), zoom=1.05 if shaded else 0.8)
    axes.view_init(elev=42, azim=-62)
    axes.grid(False)
    axes.zaxis.set_major_locator(MaxNLocator(4))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_visible(False)
    axes.set_title(f"Skin at {seconds(scene, np.array(moment)):.2f} s ({surface.name})", y=1.0)
    if shaded and bar:
        figure.colorbar(mappable(surface.scale), ax=axes, shrink=0.55, pad=0.12).set_label("depth [mm]")


def _corners(low: np.ndarray, high: np.ndarray) -> list[tuple[float, float]]:
    return [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]), (low[0], low[1])]
