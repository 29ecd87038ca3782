"""Draws a scene as one page (PNG) with matplotlib, without a display."""

from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tacdata.viewers.backend import Backend
from tacdata.viewers.output_file import PICTURE, new_file, written_beside
from tacdata.viewers.parts.summary import plain
from tacdata.viewers.pictures import panels as panels
from tacdata.viewers.pictures.pages import other_page
from tacdata.viewers.pictures.skin import skin
from tacdata.viewers.scene.moments import moments
from tacdata.viewers.scene.scene import Scene

STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelsize": 10,
    "legend.frameon": False,
    "figure.facecolor": "white",
}
WIDTH, TITLE, LINE, SIGNALS, ROW = 16.0, 0.65, 0.2, 5.6, 2.6
"""Width of the page, and heights of the title, a line of text, the signals and a row of maps [inch]."""


class PictureBackend(Backend):
    """One page a scene; of an episode signals, skin, maps at chosen moments, taxels and tip."""

    def __init__(self, path: Path, resolution: int = 100) -> None:
        """Take the file to write and its resolution [dots per inch].

        Raises:
            UsageError: If the file exists or does not end in .png.
        """
        self._path, self._resolution = new_file(path, PICTURE), resolution

    def draw(self, scene: Scene) -> None:
        """Write the page; a crash leaves none rather than half of one."""
        with rc_context(STYLE), written_beside(self._path) as temporary:
            figure = page(scene) if scene.kind == "episode" else other_page(scene)
            FigureCanvasAgg(figure)
            figure.savefig(temporary, dpi=self._resolution)


def page(scene: Scene) -> Figure:
    """Return the page of one episode."""
    instants = moments(scene)
    rows = max(len(instants), 2) if scene.maps else 2
    text = plain(scene.summary)
    heights = [TITLE + LINE * len(text.splitlines()), SIGNALS, ROW * rows]
    figure = Figure(figsize=(WIDTH, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=heights)
    head, upper, lower = parts
    head.text(0.012, 1 - 0.15 / heights[0], scene.title, fontsize=16, weight="bold", va="top")
    head.text(0.012, 1 - 0.55 / heights[0], text, va="top", linespacing=1.35)
    left, right = upper.subfigures(1, 2, width_ratios=[1.75, 1])
    panels.signals(left, scene, instants)
    skin(right, scene, instants)
    if scene.maps:
        left, right = lower.subfigures(1, 2, width_ratios=[1.75, 1])
        panels.maps(left, scene, instants)
        panels.taxels_and_tip(right, scene, instants, stacked=True)
    else:
        panels.taxels_and_tip(lower, scene, instants, stacked=False)
    return figure
