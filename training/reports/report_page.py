"""The report of several runs as one HTML page: splits, tables, pictures, reliability."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, BinaryIO

import numpy as np
from matplotlib.figure import Figure

from tacdata.training.frames.frames import Frames
from tacdata.training.reports.comparison import Group, groups, verdicts
from tacdata.training.reports.html_page import HtmlPage
from tacdata.training.reports.score_picture import draw_cases
from tacdata.training.reports.score_sheet import markdown, number, title
from tacdata.training.scoring.evaluate import METRICS, Evaluation
from tacdata.training.scoring.published import TABLE_1


@dataclass(frozen=True)
class Scored:
    """One run with its scores."""

    name: str
    """Network, and changes of its recipe from the paper's."""
    evaluation: Evaluation
    frames: Frames
    """Data of the score."""


def page(runs: list[Scored], trials: str = "", impossible: dict[str, str] | None = None) -> str:
    """Return the page.

    Args:
        runs: Scored runs, in the order in which they are to stand.
        trials: The sheet of the paper's configuration-referenced evaluations, as Markdown; empty for none.
        impossible: Split -> why it could not be made.
    """
    result = HtmlPage("Scores by split")
    runs, settings = _briefly(runs)
    group_list = groups((run.name, run.evaluation.document) for run in runs)
    result.paragraph(runs[0].evaluation.document["statement"])
    _overview(result, group_list, impossible or {})
    for sentence in settings:
        result.paragraph(sentence, note=True)
    _data(result, runs[0].frames)
    if any(group.reliability for group in group_list):
        result.heading("Reliability of the pixels' uncertainty")
        words = (
            "Share of errors inside intervals that were calibrated on validation episodes, against what should "
            "lie there: on the diagonal the uncertainty is right, below it too small."
        )
        result.picture(lambda stream: _draw_reliability(stream, group_list), words)
    if trials:
        result.markdown(trials)
    shown_pairs: set[tuple[str, str]] = set()
    for run in runs:
        document = run.evaluation.document
        key = run.name, document["split"]["name"]
        if key in shown_pairs:
            continue  # of several seeds the first is shown; their figures are in the first table
        shown_pairs.add(key)
        _run(result, run, document)
    return result.text


def _briefly(runs: list[Scored]) -> tuple[list[Scored], list[str]]:
    """Return the runs by the names of their networks, numbered where several recipes share one, and the recipes."""
    names = list(dict.fromkeys(run.name for run in runs))
    bare = [name.partition(" (")[0] for name in names]
    short = {
        name: words if bare.count(words) == 1 else f"{words} {bare[: k + 1].count(words)}"
        for k, (name, words) in enumerate(zip(names, bare, strict=True))
    }
    recipes = [f"{short[name]}: {name.partition(' (')[2].removesuffix(')')}." for name in names if " (" in name]
    return [replace(run, name=short[run.name]) for run in runs], recipes


def _overview(result: HtmlPage, group_list: list[Group], impossible: dict[str, str]) -> None:
    result.heading("Splits, networks and seeds")
    result.paragraph(
        "Mean over the frames in contact, then mean ± SD over seeds. Bold: better than the paper's mean and than every "
        "predictor without a network on the same split."
    )
    heads = ["Network", "Split", "Seeds", "Frames", *(title(m) for m in METRICS), "ms a frame"]
    rows = [
        [g.name, g.split, str(len(g.seeds)), str(g.frames), *(_cell(g, m) for m in METRICS), f"{g.pace:.2f}"]
        for g in group_list
    ]
    paper = ["The paper, its own data", "not said", "", "", *(number(TABLE_1[m]["mean"]) for m in METRICS), ""]
    metrics = list(METRICS)
    result.table(
        heads,
        [*rows, *_baseline_rows(group_list), paper],
        lambda row, column: (
            row < len(group_list) and 4 <= column < 9 and group_list[row].stands_out(metrics[column - 4])
        ),
    )
    for sentence in verdicts(group_list):
        result.paragraph(sentence, note=True)
    for split, reason in impossible.items():
        result.paragraph(f"Split {split} was not possible: {reason}", note=True)


def _baseline_rows(group_list: list[Group]) -> list[list[str]]:
    """Return a row for each predictor without a network and split; networks on one split share their frames."""
    splits = {group.split: group for group in group_list if group.baselines}
    return [
        [
            f"without a network: {name}",
            split,
            str(len(group.seeds)),
            str(group.frames),
            *(number(values[m]) for m in METRICS),
            "",
        ]
        for split, group in splits.items()
        for name, values in group.baselines.items()
    ]


def _cell(group: Group, metric: str) -> str:
    deviation = group.deviation(metric)
    return number(group.mean(metric)) + ("" if deviation is None else f" ± {number(deviation)}")


def _data(result: HtmlPage, frames: Frames) -> None:
    result.heading("Data")
    specimens = sorted({e.specimen for e in frames.episodes if e.specimen})
    speeds = [e.speed for e in frames.episodes if e.speed is not None]
    words = f"{len(frames.episodes)} episodes, {len(frames.taxels)} frames, dataset {frames.dataset_hash[:12]}"
    words += f", sensor {frames.sensor.name} {frames.sensor.content_hash[:12]}"
    words += f", specimens: {', '.join(specimens)}" if specimens else ""
    words += f", {min(speeds):g} to {max(speeds):g} mm/s" if speeds else ""
    result.paragraph(words + ".")
    result.picture(lambda stream: _draw_coverage(stream, frames), "Nominal contact centres and depths by indenter.")


def _run(result: HtmlPage, run: Scored, document: dict[str, Any]) -> None:
    split = document["split"]
    result.heading(f"{run.name}, split {split['name']}, seed {split['seed']}")
    result.picture(
        lambda stream: draw_cases(stream, run.evaluation, run.frames),
        "Best, median and worst press at full depth: signals, label, prediction, error.",
    )
    result.markdown(markdown(document).split("\n", 2)[2])
    result.paragraph(f"Test episodes: {', '.join(map(str, split['episodes']))}.", note=True)


def _draw_coverage(stream: BinaryIO, frames: Frames) -> None:
    figure = Figure(figsize=(11, 3.6), dpi=90, layout="constrained")
    plane, depths = figure.subplots(1, 2, width_ratios=[1.3, 1])
    names = sorted({e.indenter for e in frames.episodes})
    for name in names:
        spans = [e for e in frames.episodes if e.indenter == name]
        plane.scatter(
            [e.x for e in spans],
            [e.y for e in spans],
            s=[8 + 20 * max(e.depth, 0) for e in spans],
            label=name,
            alpha=0.7,
        )
    half_x, half_y = (n * frames.sensor.map.pixel_pitch / 2 for n in frames.sensor.map.shape)
    plane.set(xlim=(-half_x, half_x), ylim=(-half_y, half_y), xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    plane.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    depths.hist([[e.depth for e in frames.episodes if e.indenter == n] for n in names], bins=12, stacked=True)
    depths.set(xlabel="depth [mm]", ylabel="episodes")
    figure.savefig(stream, format="png")


def _draw_reliability(stream: BinaryIO, group_list: list[Group]) -> None:
    figure = Figure(figsize=(8.4, 4.6), dpi=90, layout="constrained")
    axes = figure.subplots()
    axes.plot([0.4, 1], [0.4, 1], color="black", linewidth=0.8, linestyle="--")
    several = len({group.name for group in group_list}) > 1
    for group in (g for g in group_list if g.reliability):
        levels = sorted(group.reliability)
        inside = [float(np.mean(group.reliability[level])) for level in levels]
        words = f"{group.name}, {group.split}" if several else group.split
        axes.plot(levels, inside, "o-", markersize=3.5, label=words)
    axes.set(xlabel="should lie inside", ylabel="does", xlim=(0.4, 1.01), ylim=(0.0, 1.01))
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(stream, format="png")
