"""The learning curve as a picture and as a table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

METRICS = {
    "centroid_error": "centroid error [px]",
    "contact_rmse": "contact RMSE [mm]",
    "iou_deep": "IoU, frames deeper than 0.2 mm",
}
"""Metrics that are drawn, and their axes' words."""


def summary(document: dict[str, Any]) -> dict[tuple[str, int], dict[str, tuple[float, float]]]:
    """Return mean and standard deviation (NaN of one seed) of every metric, by start and number of presses."""
    groups: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for point in document["points"]:
        groups.setdefault((point["start"], point["presses"]), []).append(point)
    return {
        key: {metric: _spread([point[metric] for point in points]) for metric in METRICS}
        for key, points in sorted(groups.items())
    }


def table(document: dict[str, Any]) -> str:
    """Return the curve as text: one line a start and number of presses."""
    lines = [f"{'start':<12} {'presses':>7}  {'centroid [px]':>15}  {'RMSE [mm]':>15}  {'IoU > 0.2 mm':>15}"]
    for (start, presses), means in summary(document).items():
        cells = (_cell(*means[metric], digits) for metric, digits in zip(METRICS, (2, 3, 2), strict=True))
        lines.append(f"{start:<12} {presses:>7}  {'  '.join(f'{cell:>15}' for cell in cells)}")
    return "\n".join(lines)


def draw(path: Path, document: dict[str, Any]) -> None:
    """Write the curve as PNG: a panel a metric, a line a start, bars of one standard deviation over the seeds."""
    figure = Figure(figsize=(12, 3.8), dpi=110, layout="constrained")
    means = summary(document)
    starts = sorted({start for start, _ in means}, key=lambda start: (start != "pretrained", start))
    numbers = sorted({presses for _, presses in means})
    for axes, (metric, words) in zip(figure.subplots(1, len(METRICS)), METRICS.items(), strict=True):
        for start in starts:
            at = [presses for presses in numbers if (start, presses) in means]
            values = np.array([means[start, presses][metric] for presses in at])
            label = "pretrained on simulated presses" if start == "pretrained" else f"{start}, from random weights"
            axes.errorbar(
                [numbers.index(n) for n in at], values[:, 0], values[:, 1], marker="o", capsize=3, label=label
            )
        axes.set_xticks(range(len(numbers)), [str(number) for number in numbers])
        axes.set_xlabel("recorded presses trained on")
        axes.set_ylabel(words)
        axes.set_ylim(bottom=0, top=1 if metric == "iou_deep" else None)
        axes.grid(alpha=0.3)
    seeds = len({point["seed"] for point in document["points"]})
    figure.suptitle(
        f"{len(document['held_out'])} presses held out"
        + (f"; mean and standard deviation over {seeds} seeds" if seeds > 1 else "; one seed")
    )
    figure.axes[0].legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _cell(mean: float, deviation: float, digits: int) -> str:
    """Return mean and deviation as text; the deviation of one seed is not known."""
    return f"{mean:.{digits}f}" + ("" if np.isnan(deviation) else f" +- {deviation:.{digits}f}")


def _spread(values: list[float]) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
