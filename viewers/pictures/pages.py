"""Pages of scenes that are no episode: demonstrations, targets, verdicts, comparisons."""

from collections.abc import Iterable
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from tacdata.viewers.parts.summary import plain
from tacdata.viewers.pictures import panels as panels
from tacdata.viewers.scene.color_scale import HUES, taxel_colors
from tacdata.viewers.scene.moments import moments
from tacdata.viewers.scene.scene import Bars, Cloud, Curves, Scene

WIDTH, TITLE, LINE, SPACE, MAPS, CURVES = 16.0, 0.65, 0.2, 5.2, 2.6, 1.9
"""Width of the page, and heights of title, line of text, space, a row of maps and a row of curves [inch]."""
BAR, MOST_BARS = 0.24, 26
"""Height of a bar [inch], and bars that are drawn at most, the first of them."""
COLORS = [tuple(channel / 255 for channel in hue) for hue in HUES]
TITLE_LETTERS = 40
"""Letters of a line of a title above bars, of three sets side by side."""
FULL = 6
"""Sets of curves that a page holds, unless it shows a hand."""


def other_page(scene: Scene) -> Figure:
    """Return the page: words, fingertips in space, maps at up to three moments, bars, curves."""
    text = plain(scene.summary.replace("## ", ""))
    instants = moments(scene) if scene.maps else ()
    curves = [c for c in scene.curves if not c.name.startswith("clock/")]
    curves = curves if scene.kind == "hand" else curves[:FULL]  # of a hand every finger has its own
    rows = (len(curves) + 1) // 2
    bars = max((len(b.values[:MOST_BARS]) for b in scene.bars), default=0)
    heights = {
        "head": TITLE + LINE * len(text.splitlines()),
        "space": SPACE if scene.trails else 0.0,
        "maps": MAPS * len(instants),
        "bars": 0.9 + BAR * bars if bars else 0.0,
        "curves": CURVES * rows,
    }
    drawn = {name: height for name, height in heights.items() if height}
    figure = Figure(figsize=(WIDTH, sum(drawn.values())), layout="constrained")
    subfigures: Any = figure.subfigures(len(drawn), 1, height_ratios=list(drawn.values()), squeeze=False)
    parts = dict(zip(drawn, subfigures[:, 0], strict=True))
    parts["head"].text(0.012, 1 - 0.15 / heights["head"], scene.title, fontsize=16, weight="bold", va="top")
    parts["head"].text(0.012, 1 - 0.55 / heights["head"], text, va="top", linespacing=1.35)
    if scene.trails:
        space(parts["space"], scene)
    if instants:
        panels.maps(parts["maps"], scene, instants)
    if bars:
        for axes, content in zip(parts["bars"].subplots(1, len(scene.bars), squeeze=False)[0], scene.bars, strict=True):
            bar_chart(axes, content)
    if curves:
        grid = parts["curves"].subplots(rows, 2 if len(curves) > 1 else 1, squeeze=False).ravel()
        for axes, content in zip(grid, curves, strict=False):
            course(axes, content, scene)
        if scene.kind == "comparison":
            one_scale(grid, curves)
        for axes in grid[len(curves) :]:
            axes.set_visible(False)
    return figure


def one_scale(grid: Iterable[Axes], curves: list[Curves]) -> None:
    """Give curves of one group, such as residuals of two models, the same axis, so that their heights compare."""
    groups: dict[str, list[Axes]] = {}
    for axes, curve in zip(grid, curves, strict=False):
        groups.setdefault(curve.name.split("/")[0], []).append(axes)
    for members in groups.values():
        # Residuals of two models compare by height only on one axis.
        low, high = zip(*(axes.get_ylim() for axes in members), strict=True)
        for axes in members:
            axes.set_ylim(min(low), max(high))


def space(figure: SubFigure, scene: Scene) -> None:
    """Draw paths in space, from the side and from above, dotted where bridged, and where each finger touches most."""
    for number, (horizontal, up, name) in enumerate(((0, 2, "from the side"), (0, 1, "from above"))):
        axes = figure.add_subplot(1, 2, number + 1)
        for trail in scene.trails:
            color = COLORS[trail.hue % len(COLORS)]
            for doubtful, style in ((False, "-"), (True, ":")):
                for k, strip in enumerate(trail.strips(doubtful)):
                    label = trail.name if k == 0 and not doubtful else None
                    look: dict[str, Any] = {"color": color, "linewidth": 1.5, "alpha": 0.4 if trail.faint else 1.0}
                    axes.plot(strip[:, horizontal], strip[:, up], style, label=label, **look)
        for cloud in scene.clouds:
            touches = cloud.position[_most(cloud)]
            axes.plot(*touches[:, [horizontal, up]].T, ".", color="0.2", markersize=0.8)
        axes.set(xlabel=f"{'xyz'[horizontal]} [mm]", ylabel=f"{'xyz'[up]} [mm]", title=f"Fingertips {name}")
        axes.set_aspect("equal", adjustable="datalim")
        if number == 0:
            axes.legend(loc="best", fontsize=8)


def _most(cloud: Cloud) -> slice:
    """Return the points of the time with the deepest one."""
    if not len(cloud.values):
        return slice(0, 0)
    ends = np.cumsum(cloud.count)
    row = int(np.searchsorted(ends, np.argmax(cloud.values), side="right"))
    return slice(int(ends[row] - cloud.count[row]), int(ends[row]))


def bar_chart(axes: Axes, bars: Bars) -> None:
    """Draw bars downwards in the order given, with their values and the mark."""
    values = np.asarray(bars.values, float)[:MOST_BARS]
    place = np.arange(len(values))
    axes.barh(place, np.nan_to_num(values), color=COLORS[0], height=0.7)
    axes.set_yticks(place, bars.labels[:MOST_BARS])
    axes.invert_yaxis()
    if bars.logarithmic:
        axes.set_xscale("log")
    if bars.mark is not None:
        axes.axvline(bars.mark, color="black", linestyle="--", linewidth=1)
    for at, value in zip(place, values, strict=True):
        end = max(float(value), 0.0) if np.isfinite(value) else 0.0
        axes.text(end, float(at), f" {value:.3g}", va="center", fontsize=8)
    remainder = len(bars.values) - len(values)
    title = bars.title + (f" (first {len(values)} of {len(bars.values)})" if remainder else "")
    axes.set_title(fill(title, TITLE_LETTERS), fontsize=10)
    axes.margins(x=0.15)


def course(axes: Axes, curves: Curves, scene: Scene) -> None:
    """Draw a set of curves over seconds, grey where they are doubtful."""
    array = next((a for a in scene.arrays if a.values.shape[1] == len(curves.labels)), None)
    colors = taxel_colors(array.columns, array.rows) / 255 if array is not None and len(curves.labels) > 6 else None
    seconds = panels.seconds(scene, curves.time_ns)
    for k, (label, values) in enumerate(zip(curves.labels, np.asarray(curves.values, float).T, strict=True)):
        color = tuple(colors[k]) if colors is not None else COLORS[k % len(COLORS)]
        width, alpha = (3.5, 0.4) if label == "measured" else (1.1, 1.0)  # models are drawn over it, and fit it
        axes.plot(seconds, values, color=color, linewidth=width, alpha=alpha, label=label)
    if len(curves.doubtful):
        panels.shade_bridged(axes, seconds, curves.doubtful, label="bridged")
    if len(curves.labels) <= 6:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=7, ncols=6, borderaxespad=0.1)
    axes.set_title(curves.name.replace("_", " ").replace("/", ": "), fontsize=10)
    axes.set(xlabel="time [s]", ylabel=f"[{curves.unit}]")
