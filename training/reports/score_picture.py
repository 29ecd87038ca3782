"""Scores as a picture: the table, and the best, the median and the worst press."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from tacdata.training.frames.frames import Frames
from tacdata.training.reports.score_sheet import number, spread, title
from tacdata.training.scoring.evaluate import METRICS, EpisodeResult, Evaluation
from tacdata.training.scoring.published import TABLE_1


def draw(path: Path, evaluation: Evaluation, frames: Frames) -> None:
    """Write the picture of an evaluation as PNG."""
    cases = cases_of(evaluation.episodes)
    figure = Figure(figsize=(12.5, 3.3 + 2.6 * len(cases)), dpi=110, layout="constrained")
    halves = figure.add_gridspec(2, 1, height_ratios=[3.3, max(2.6 * len(cases), 0.1)])
    _draw_table(figure.add_subfigure(halves[0]).subplots(), evaluation.document)
    if cases:
        _draw_cases(figure.add_subfigure(halves[1]), cases, frames)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def cases_of(episodes: tuple[EpisodeResult, ...]) -> list[tuple[str, EpisodeResult, int, float]]:
    """Return name, episode, frame and contact RMSE [mm] of the best, median and worst press at full depth."""
    ranked = []
    for episode in episodes:
        errors = np.where(episode.full, episode.scores.contact_rmse, np.nan)
        defined = np.flatnonzero(np.isfinite(errors))
        if len(defined):
            middle = int(defined[len(defined) // 2])
            ranked.append((float(errors[middle]), episode.span.number, episode, middle))
    ranked.sort(key=lambda entry: entry[:2])
    places = {"best": 0, "median": len(ranked) // 2, "worst": len(ranked) - 1} if len(ranked) > 2 else {}
    if 0 < len(ranked) <= 2:
        places = {"best": 0, "worst": len(ranked) - 1} if len(ranked) == 2 else {"only": 0}
    return [(name, ranked[k][2], ranked[k][3], ranked[k][0]) for name, k in places.items()]


def _draw_table(axes: Axes, document: dict[str, Any]) -> None:
    axes.set_axis_off()
    heads = ["Metric (frames in contact)", "Median", "P90", "Mean ± SD", "Paper: median", "P90", "Mean ± SD"]
    rows = []
    for metric in METRICS:
        ours, theirs = document["contact_frames"][metric], TABLE_1[metric]
        rows.append(
            [
                title(metric),
                number(ours["median"]),
                number(ours["p90"]),
                spread(ours),
                number(theirs["median"]),
                number(theirs["p90"]),
                spread(theirs),
            ]
        )
    table = axes.table(
        rows,
        colLabels=heads,
        bbox=Bbox.from_bounds(0.0, 0.27, 1.0, 0.73),
        cellLoc="right",
        edges="horizontal",
        colWidths=[0.27, 0.09, 0.09, 0.16, 0.13, 0.09, 0.16],
    )
    table.auto_set_font_size(False)
    table.set_fontsize(10)
    for (row, column), cell in table.get_celld().items():
        if row == 0:
            cell.set_text_props(weight="bold")
        if column == 0:
            cell.set_text_props(ha="left")
    split, success, frames = document["split"], document["success"], document["frames"]
    axes.set_title(
        f"Network {document['checkpoint']['name']}, split by {split['name']}: {len(split['episodes'])} "
        f"{split['part']} episodes, {frames['in_contact']} frames in contact",
        fontsize=12,
        loc="left",
    )
    words = document["statement"].replace(". ", ".\n", 1)
    if success["of"]:
        low, high = success["wilson_95"]
        words += (
            f"\nContact centre within one pixel at full depth: {success['count']} of {success['of']} presses "
            f"({100 * success['proportion']:.0f} %, 95 % Wilson {100 * low:.0f} to {100 * high:.0f} %). "
            f"Inference {document['inference_ms_per_frame']:.2f} ms a frame on one CPU core."
        )
    axes.text(0.0, 0.0, words, transform=axes.transAxes, fontsize=8.5, va="bottom", wrap=True)


def _draw_cases(figure: Any, cases: list[tuple[str, EpisodeResult, int, float]], frames: Frames) -> None:
    grid = figure.subplots(len(cases), 4, squeeze=False, width_ratios=[1.35, 1, 1, 1])
    pixels = frames.sensor.map
    half_x, half_y = (n * pixels.pixel_pitch / 2 for n in pixels.shape)
    top = max(float(np.max([e.label[k], e.depth[k]])) for _, e, k, _ in cases)
    image = None
    for row, (name, episode, frame, error) in zip(grid, cases, strict=True):
        span = episode.span
        _draw_signals(row[0], frames, episode, frame)
        row[0].set_title(f"{name}: episode {span.number}, {span.indenter}, {span.depth:.2f} mm", fontsize=9)
        difference = np.abs(episode.depth[frame] - episode.label[frame])
        maps = (
            ("label", episode.label[frame]),
            ("prediction", episode.depth[frame]),
            (f"|error|, contact RMSE {error:.3f} mm", difference),
        )
        for axes, (words, values) in zip(row[1:], maps, strict=True):
            image = axes.imshow(
                values.T,
                origin="lower",
                extent=(-half_x, half_x, -half_y, half_y),
                vmin=0,
                vmax=top,
                cmap="viridis",
                interpolation="nearest",
            )
            axes.plot(span.x, span.y, "+", color="white", markersize=7)
            axes.set_title(words, fontsize=9)
            axes.tick_params(labelsize=7)
        row[1].set_ylabel("y [mm]", fontsize=8)
    for axes in grid[-1, 1:]:
        axes.set_xlabel("x [mm]", fontsize=8)
    figure.colorbar(image, ax=grid[:, 1:], label="depth, and its error [mm]", shrink=0.8)


def _draw_signals(axes: Axes, frames: Frames, episode: EpisodeResult, frame: int) -> None:
    frame_slice = slice(episode.span.start, episode.span.stop)
    seconds = (frames.time_ns[frame_slice] - frames.time_ns[episode.span.start]) * 1e-9
    axes.plot(seconds, frames.taxels[frame_slice], linewidth=0.7)
    axes.axvline(float(seconds[frame]), color="black", linewidth=0.8, linestyle="--")
    axes.set_xlabel("t [s]", fontsize=8)
    axes.set_ylabel("signals [counts]", fontsize=8)
    axes.tick_params(labelsize=7)
