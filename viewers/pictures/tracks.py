"""A demonstration on one page: each finger's path, its uncertainty, and its readings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

COLORS = ("#0072B2", "#D55E00", "#009E73")
"""For x, y and z; distinct without red-green vision."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Drawn parts of one finger."""

    name: str
    position: np.ndarray
    """[m], shape (n, 3); NaN where nothing is known."""
    spread: np.ndarray
    """Standard deviation of the position [m], shape (n,)."""
    gap: np.ndarray
    """Whether the path is a bridge, shape (n,), bool."""
    depth: np.ndarray | None
    """Predicted contact depth [mm], shape (n,)."""


def draw_tracks(path: Path, seconds: np.ndarray, strips: Sequence[Strip], title: str) -> None:
    """Draw fingers below each other as a PNG, replacing one of before.

    Args:
        path: The picture.
        seconds: Times [s], shape (n,).
        strips: The fingers.
        title: Heading.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tacdata.viewers.pictures.panels import shade_bridged

    figure = Figure(figsize=(11, 2.6 * len(strips) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    axes = figure.subplots(len(strips), 1, sharex=True, squeeze=False)[:, 0]
    for axis, strip in zip(axes, strips, strict=True):
        for k, (color, name) in enumerate(zip(COLORS, "xyz", strict=True)):
            place = 1000 * strip.position[:, k]
            axis.plot(seconds, place, color=color, lw=1, label=name)
            axis.fill_between(seconds, place - 3e3 * strip.spread, place + 3e3 * strip.spread, color=color, alpha=0.25)
        shade_bridged(axis, seconds, strip.gap, label="gap")
        axis.set_ylabel(f"{strip.name} [mm]")
        if strip.depth is not None:
            felt = axis.twinx()
            felt.plot(seconds, strip.depth, color="black", lw=1, ls="--", label="predicted depth")
            felt.set_ylabel("depth [mm]")
            felt.set_ylim(bottom=0.0)
            felt.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8, frameon=False)
    axes[-1].set_xlabel("time [s]; band: three standard deviations")
    figure.savefig(path, dpi=110)
