"""The picture of a difference: both machines, their difference with the named effects, and the sizes."""

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from tacdata.reference.difference import Difference
from tacdata.reference.report import sentence, word

HEALTHY, MEASURED, FITTED = "#0072b2", "#d55e00", "#000000"
"""Okabe and Ito's blue and vermilion, and black."""
SHOWN = 3
"""Conditions that are drawn, the largest difference first."""


def draw(result: Difference, unit: str, title: str, target: Path | BinaryIO) -> None:
    """Write the picture as PNG.

    Args:
        result: The difference.
        unit: Unit of the readings.
        title: Names of the compared machines.
        target: File to write.
    """
    import textwrap

    import matplotlib

    matplotlib.use("agg")
    from matplotlib.figure import Figure

    order = sorted(range(len(result.conditions)), key=lambda k: -_size(result, k))[:SHOWN]
    figure = Figure(figsize=(4.6 * max(len(order), 2), 7.4), layout="constrained")
    figure.suptitle("\n".join([title, *textwrap.wrap(sentence(result, unit), 110)]), fontsize=11)
    axes: Any = figure.subplots(2, len(order), squeeze=False, sharex="col")
    for column, k in enumerate(order):
        _column(axes[:, column], result, k, unit, column == 0)
    figure.savefig(target, dpi=100, format="png")


def _size(result: Difference, k: int) -> float:
    condition = result.conditions[k]
    return float(np.max(np.abs(condition.difference) / np.maximum(condition.range, 1e-300)))


def _column(axes: Any, result: Difference, k: int, unit: str, first: bool) -> None:
    condition = result.conditions[k]
    channel = int(np.argmax(np.abs(condition.difference).max(axis=0) / np.maximum(condition.range, 1e-300)))
    upper, lower = axes
    for side, color, label in (
        (condition.healthy, HEALTHY, f"healthy, {len(condition.healthy)} presses"),
        (condition.measured, MEASURED, f"this machine, {len(condition.measured)} presses"),
    ):
        values = side[:, :, channel]
        low, high = np.quantile(values, [0.05, 0.95], axis=0)
        upper.fill_between(condition.time, low, high, color=color, alpha=0.2, lw=0)
        upper.plot(condition.time, values.mean(axis=0), color=color, lw=1.4, label=label)
    upper.set(title=f"{condition.name}, {result.channels[channel]}", ylabel=f"reading [{unit}]")
    lower.axhline(0.0, color="0.7", lw=0.8)
    lower.plot(condition.time, condition.difference[:, channel], color=MEASURED, lw=1.2, label="this machine - healthy")
    curve, names = np.zeros(len(condition.time)), []
    for shape, mechanism in zip(result.columns[k], result.mechanisms, strict=False):
        size = next((s for s in mechanism.sizes if (s.condition, s.channel) == (condition.name, channel)), None)
        if size is not None and size.changed and mechanism in result.named:
            curve = curve + size.value * shape.curves[:, channel]
            names.append(f"{word(mechanism.name)} {size.peak:+.2g} {unit}")
    if names:
        lower.plot(condition.time, curve, color=FITTED, lw=1.2, ls="--", label=", ".join(names))
    lower.set(xlabel="time since the press began [s]", ylabel=f"difference [{unit}]")
    lower.legend(loc="best", fontsize=8)
    if first:
        upper.legend(loc="best", fontsize=8)
