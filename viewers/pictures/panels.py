"""The panels of a page."""

from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import SubFigure
from matplotlib.patches import Circle, Rectangle

from tacdata.viewers.parts.prediction_error import frame_error, pitch
from tacdata.viewers.scene.color_scale import HUES, ColorScale, taxel_colors
from tacdata.viewers.scene.moments import nearest, picture_at
from tacdata.viewers.scene.scene import Scene

Moments = tuple[tuple[str, int], ...]
TITLES = {
    "label": "Label",
    "prediction": "Prediction",
    "error": "Prediction − label",
    "pressure": "Pressure",
    "shear": "Shear",
    "board": "Protrusions on the board",
}
INK, SHADES = "0.25", ("0.97", "0.91")


def seconds(scene: Scene, time_ns: np.ndarray) -> np.ndarray:
    """Return times [s] since the first taxel frame, of times [ns], shape (n,)."""
    return (np.asarray(time_ns) - scene.frame_ns[0]) / 1e9


def shade_bridged(axes: Axes, seconds: np.ndarray, bridged: np.ndarray, label: str | None = None) -> None:
    """Shade the times [s], shape (n,), at which a path is bridged, shape (n,), bool."""
    shade = axes.fill_between(seconds, 0, 1, where=bridged.tolist(), transform=axes.get_xaxis_transform())
    shade.set(color="0.85", linewidth=0, label=label, zorder=0)


def mappable(scale: ColorScale) -> ScalarMappable:
    """Return the arguments of a colour bar."""
    return ScalarMappable(Normalize(scale.low, scale.high), scale.colormap)


def signals(figure: SubFigure, scene: Scene, instants: Moments) -> None:
    """Draw the taxels' change above the tip's depth, over the phases."""
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1.3])
    change = next(c for c in scene.curves if c.name == "taxels/change")
    time = seconds(scene, change.time_ns)
    colors = taxel_colors(scene.taxels.columns, scene.taxels.rows) / 255
    for values, color in zip(change.values.T, colors, strict=True):
        upper.plot(time, values, color=tuple(color), linewidth=1.3)
    upper.set_ylabel(f"change since rest [{change.unit}]")
    upper.set_title("Taxel signals", pad=20 if scene.phases else 6)
    key(upper, scene)
    if scene.tip is not None:
        depth = scene.tip.values[:, 2]
        lower.plot(seconds(scene, scene.tip.time_ns), depth, color=INK, linewidth=1.5, label="nominal")
        lower.axhline(0, color=INK, linewidth=0.7, linestyle=":")
        reported = next((c for c in scene.curves if c.name == "tip/reported"), None)
        if reported is not None:
            reported_at, color = seconds(scene, reported.time_ns), np.array(HUES[5]) / 255
            words = "reported by the controller"
            lower.plot(reported_at, reported.values[:, 2], ".", color=color, markersize=4, label=words)
        lower.legend(loc="upper center")
        # Travel high above the skin would flatten the press; it runs out of the panel instead.
        lower.set_ylim(1.15 * max(depth.max(), 0.1), max(depth.min(), -2 * max(depth.max(), 1.0)))
    lower.set_ylabel("tip depth [mm]")
    lower.set_xlabel("time since the first frame [s]")
    # A recording of one frame still gets an axis of some width.
    upper.set_xlim(time[0], max(time[-1], time[0] + 1e-3))
    for axes in (upper, lower):
        phases(axes, scene, named=axes is upper)
        for _, moment in instants:
            axes.axvline(seconds(scene, np.array(moment)), color=INK, linewidth=0.8, linestyle="--")


def phases(axes: Axes, scene: Scene, named: bool) -> None:
    """Shade the phases and name them above the axes."""
    low, high = axes.get_xlim()
    for number, span in enumerate(scene.phases):
        start, end = np.clip(seconds(scene, np.array([span.start_ns, span.end_ns])), low, high)
        if end <= start:
            continue
        axes.axvspan(start, end, color=SHADES[number % 2], zorder=0, linewidth=0)
        if named:
            above: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "ha": "center"}
            axes.text((start + end) / 2, 1.015, span.name, color=INK, fontsize=9, **above)


def key(axes: Axes, scene: Scene) -> None:
    """Draw the colours of the curves as the array that they come from."""
    inset = axes.inset_axes((0.05, 0.62, 0.15, 0.32))
    columns, rows = scene.taxels.columns, scene.taxels.rows
    # A legend of two dozen names would hide the curves.
    inset.imshow(taxel_colors(columns, rows).reshape(rows, columns, 3), origin="lower", aspect="equal")
    inset.set_xticks(range(columns))
    inset.set_yticks(range(rows))
    inset.tick_params(length=0, labelsize=7, pad=1)
    inset.set_xlabel("column", fontsize=7, labelpad=1)
    inset.set_ylabel("row", fontsize=7, labelpad=1)


def maps(figure: SubFigure, scene: Scene, instants: Moments) -> None:
    """Draw every map at every chosen moment: moments downwards, kinds across, one bar for each scale."""
    grid = figure.subplots(len(instants), len(scene.maps), squeeze=False, sharex=True, sharey=True)
    for row, (name, moment) in zip(grid, instants, strict=True):
        row[0].set_ylabel(f"{name}, {seconds(scene, np.array(moment)):.2f} s\ny [mm]")
        for axes, layer in zip(row, scene.maps, strict=True):
            image(axes, picture_at(layer, moment).T, (layer.x, layer.y), layer.scale)
            tip_mark(axes, scene, moment)
            if layer.scale.signed:
                error = _frame_error(scene, moment)
                axes.text(0.98, 0.03, error, transform=axes.transAxes, ha="right", fontsize=8, color=INK)
    first = scene.maps[0]
    for axis, centers in (("x", first.x), ("y", first.y)):
        # All share axes, and the protrusions' own map is smaller.
        grid[0, 0].set(**{f"{axis}lim": _ends(centers)})
    for axes, layer in zip(grid[0], scene.maps, strict=True):
        axes.set_title(TITLES.get(layer.name, layer.name))
    for axes in grid[-1]:
        axes.set_xlabel("x [mm]")
    # Neighbours on one scale share a bar; separate maps would share it across the panels between.
    for scale, group in groupby(range(len(scene.maps)), key=lambda k: scene.maps[k].scale):
        columns = list(group)
        # One map alone keeps its proportions, and is narrower than its column.
        part = 0.9 if len(scene.maps) > 1 else 0.3
        bar = figure.colorbar(
            mappable(scale), ax=grid[:, columns], location="bottom", shrink=part, aspect=20 * len(columns)
        )
        bar.set_label(_bar_label(scale, [scene.maps[k].name for k in columns]))


def _frame_error(scene: Scene, moment: int) -> str:
    label, prediction = scene.map_named("label"), scene.map_named("prediction")
    if label is None or prediction is None:
        return ""
    return str(frame_error(picture_at(label, moment), picture_at(prediction, moment), pitch(label)))


def _bar_label(scale: ColorScale, names: list[str]) -> str:
    if scale.unit == "kPa":
        return f"{' and '.join(names)} [kPa]".replace("board", "pressure on the board")
    if not scale.signed:
        return "depth [mm]"
    return "error of depth [mm]" if names == ["error"] else "difference of depth [mm]"


def image(axes: Axes, values: np.ndarray, centers: tuple[np.ndarray, np.ndarray], scale: ColorScale) -> None:
    """Draw values, shape (rows, columns), whose centres along x and y [mm] are given."""
    (left, right), (bottom, top) = map(_ends, centers)
    axes.imshow(
        values, origin="lower", extent=(left, right, bottom, top), cmap=scale.colormap, vmin=scale.low, vmax=scale.high
    )
    axes.spines[:].set_visible(False)


def _ends(centers: np.ndarray) -> tuple[float, float]:
    """Return where pixels with these centres [mm] begin and end."""
    half = (centers[1] - centers[0]) / 2 if len(centers) > 1 else 0.5
    return float(centers[0] - half), float(centers[-1] + half)


def tip_mark(axes: Axes, scene: Scene, moment: int) -> None:
    """Mark the nominal tip."""
    if scene.tip is not None:
        x, y, _ = scene.tip.values[nearest(scene.tip.time_ns, moment)]
        axes.plot(x, y, "+", color="white", markersize=9, markeredgewidth=2.4)
        axes.plot(x, y, "+", color="black", markersize=8, markeredgewidth=1.0)


def taxels_and_tip(figure: SubFigure, scene: Scene, instants: Moments, stacked: bool) -> None:
    """Draw the taxels' signal at the deepest moment and the tip's path over the array."""
    moment = dict(instants)["deepest"]
    first, second = figure.subplots(*((2, 1) if stacked else (1, 2)))
    taxels = scene.taxels
    centers = taxels.centers.reshape(taxels.rows, taxels.columns, 3)
    values = taxels.grid[nearest(taxels.time_ns, moment)]
    image(first, values, (centers[0, :, 0], centers[:, 0, 1]), taxels.scale)
    tip_mark(first, scene, moment)
    first.set_title(f"Taxels at {seconds(scene, np.array(moment)):.2f} s")
    figure.colorbar(mappable(taxels.scale), ax=first, shrink=0.8).set_label(f"change since rest [{taxels.scale.unit}]")
    low, high = scene.corners
    second.add_patch(Rectangle(low[:2], *(high - low)[:2], fill=False, edgecolor="0.6"))
    for x, y, _ in taxels.centers:
        second.add_patch(Circle((x, y), taxels.radius, facecolor="0.92", edgecolor="0.75"))
    if scene.tip is not None:
        path = scene.tip.values[np.argsort(scene.tip.values[:, 2], kind="stable")]
        touching = path[:, 2] > 0
        scale = scene.surfaces[0].scale
        bar = mappable(replace(scale, high=max(scale.high, path[:, 2].max())))
        second.plot(*scene.tip.values[:, :2].T, "-", color="0.5", linewidth=1)
        second.scatter(*path[~touching, :2].T, s=14, color="0.5", label="above the skin")
        colors: dict[str, Any] = {"c": path[touching, 2], "cmap": bar.cmap, "norm": bar.norm}
        second.scatter(*path[touching, :2].T, s=26, label="in the skin", **colors)
        figure.colorbar(bar, ax=second, shrink=0.8).set_label("tip depth [mm]")
    second.set(xlim=(low[0] - 0.5, high[0] + 0.5), ylim=(low[1] - 0.5, high[1] + 0.5), aspect="equal")
    second.set_title("Path of the tip over the taxels (grey: above the skin)")
    for axes in (first, second):
        axes.set(xlabel="x [mm]", ylabel="y [mm]")
