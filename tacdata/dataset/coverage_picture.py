"""Where and how deep a dataset was pressed, as a picture."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from tacdata.dataset.reader import Dataset
from tacdata.plans import Press

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Measure = Callable[[Press], float]


def draw(path: Path | BinaryIO, dataset: Dataset) -> None:
    """Write the picture as PNG: presses by place, along x and along y by depth; episodes without record are left out.

    Raises:
        FormatError: If the dataset is of several sensors.
    """
    from matplotlib.figure import Figure

    presses = [episode.press for episode in dataset.episodes if episode.press]
    sensor = dataset.sensor
    half_x, half_y = (n * sensor.map.pixel_pitch / 2 for n in sensor.map.shape)
    figure = Figure(figsize=(13, 3.8), dpi=100, layout="constrained")
    plane, along_x, along_y = figure.subplots(1, 3, width_ratios=[1.35, 1, 1])
    names = sorted({press.indenter_name for press in presses})
    views: list[tuple[Axes, Measure, Measure]] = [
        (plane, lambda p: p.x, lambda p: p.y),
        (along_x, lambda p: p.x, lambda p: p.depth),
        (along_y, lambda p: p.y, lambda p: p.depth),
    ]
    for axes, horizontal, vertical in views:
        for number, name in enumerate(names):
            places = [(horizontal(press), vertical(press)) for press in presses if press.indenter_name == name]
            axes.scatter(*zip(*places, strict=True), s=14, color=f"C{number % 10}", label=name, alpha=0.75)
    centers = sensor.taxels.centers
    plane.plot(centers[:, 0], centers[:, 1], "+", color="0.6", markersize=5, zorder=0)
    plane.set(xlim=(-half_x, half_x), ylim=(-half_y, half_y), aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    plane.set_title(f"{len(presses)} presses; crosses: taxels", fontsize=9)
    along_x.set(xlabel="x [mm]", ylabel="depth [mm]")
    along_y.set(xlabel="y [mm]", ylabel="depth [mm]")
    for axes in (along_x, along_y):
        axes.invert_yaxis()
    if names:
        along_y.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, format="png")
