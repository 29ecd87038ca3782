"""The picture of `tacdata plan`: where and how deep each indenter presses, and when."""

from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.plans import Plan
from tacdata.sensor import Sensor

SIDES = {"+x": (1, 0), "-x": (-1, 0), "+y": (0, 1), "-y": (0, -1)}
MARKS = "osD^vP*Xd"
HOVER = -0.3
"""Presses without contact are drawn at this depth at most [mm], lest one high fly-over flatten all the others."""


def draw(plan: Plan, sensor: Sensor, press_seconds: tuple[float, ...], path: Path) -> None:
    """Write one page as PNG; an older one is replaced.

    Args:
        plan: The plan.
        sensor: The skin that it was made for.
        press_seconds: Expected duration of each press [s].
        path: The picture's file.
    """
    import matplotlib

    matplotlib.use("agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6), layout="constrained")
    pad, course = figure.subplots(1, 2, width_ratios=[3, 2])
    names = list(plan.document["indenters"] if plan.document else {press.indenter_name for press in plan.presses})
    points = _pad(pad, plan, sensor, names)
    figure.colorbar(points, ax=pad, label="depth [mm], below 0: no contact", shrink=0.8)
    _course(course, plan, press_seconds, names)
    minutes = sum(press_seconds) / 60
    figure.suptitle(f"{plan.name}: {len(plan.presses)} presses, about {minutes:.0f} min")
    figure.savefig(path, dpi=110)


def _pad(axes, plan: Plan, sensor: Sensor, names: list[str]):
    from matplotlib.patches import Rectangle

    skin = sensor.skin
    corner = (-skin.size_x / 2, -skin.size_y / 2)
    axes.add_patch(Rectangle(corner, skin.size_x, skin.size_y, facecolor="0.96", edgecolor="0.5", label="skin"))
    axes.plot(*sensor.taxels.centers.T, "s", color="0.85", markersize=11, zorder=1, label="taxel")
    depths = [max(press.depth, HOVER) for press in plan.presses]
    scale = {"vmin": min(0.0, *depths), "vmax": max(depths), "cmap": "viridis"}
    rim = {"edgecolors": "black", "linewidths": 0.4, "zorder": 3}
    points: Any = None
    for number, name in enumerate(names):
        presses = [press for press in plan.presses if press.indenter_name == name]
        # Shallow ones last, so that a deep press at the same site does not hide them: rings of growing size.
        presses.sort(key=lambda press: -press.depth)
        x, y, depth = np.array([(press.x, press.y, max(press.depth, HOVER)) for press in presses]).reshape(-1, 3).T
        size, mark = 20 + 110 * np.maximum(depth, 0.0), MARKS[number % len(MARKS)]
        points = axes.scatter(x, y, size, c=depth, label=name, marker=mark, **rim, **scale)
    for press in (p for p in plan.presses if p.approach_from):
        dx, dy = (plan.motion.run_up * c for c in SIDES[press.approach_from])
        axes.annotate(
            "", (press.x, press.y), (press.x + dx, press.y + dy), zorder=4, arrowprops={"arrowstyle": "->", "lw": 0.8}
        )
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    axes.margins(0.05)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=5, fontsize=8, frameon=False)
    return points


def _course(axes, plan: Plan, press_seconds: tuple[float, ...], names: list[str]) -> None:
    begins = np.array([0.0, *accumulate(press_seconds)][:-1]) / 60
    for number, name in enumerate(names):
        rows = [k for k, press in enumerate(plan.presses) if press.indenter_name == name]
        depths = [max(plan.presses[k].depth, HOVER) for k in rows]
        axes.plot(begins[rows], depths, MARKS[number % len(MARKS)], ms=4, label=name)
    last = None
    for press, begin in zip(plan.presses, begins, strict=True):
        # A person works there: the time axis does not count it.
        if last not in (None, press.mounting):
            axes.axvline(begin, color="0.6", linewidth=0.8)
            axes.text(begin, 0.99, " mount", transform=axes.get_xaxis_transform(), fontsize=7, va="top")
        last = press.mounting
    axes.axhline(0.0, color="0.6", linewidth=0.6)
    axes.set(xlabel="time [min], mounting not counted", ylabel="depth [mm]")
    axes.legend(fontsize=8)
