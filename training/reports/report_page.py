"""The report of several runs as one HTML page: summary, tables, maps, splits, reliability."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from tacdata.pages import Cell, HtmlPage, Items, PageHeader, Paragraph, PixelMap, Plot, Prose, Series, Table
from tacdata.training.frames.frames import Frames
from tacdata.training.reports.comparison import Group, groups, verdicts
from tacdata.training.reports.score_picture import cases_of
from tacdata.training.reports.score_sheet import markdown, number, title
from tacdata.training.scoring.evaluate import METRICS, Evaluation
from tacdata.training.scoring.published import TABLE_1

COLORS = ("blue", "vermilion", "green", "purple", "amber", "sky", "ink", "grey")
"""Colours of indenters and networks, in their order."""
MOST_SIGNALS = 150
"""Points of each signal that a page holds."""


@dataclass(frozen=True)
class Scored:
    """One run with its scores."""

    name: str
    """Network, and changes of its recipe from the paper's."""
    evaluation: Evaluation
    frames: Frames
    """Data of the score."""
    folder: Path | None = None
    """Folder of the run, if it is kept."""


def page(runs: list[Scored], trials: str = "", impossible: dict[str, str] | None = None) -> str:
    """Return the page.

    Args:
        runs: Scored runs, in the order in which they are to stand.
        trials: The sheet of the paper's configuration-referenced evaluations, as Markdown; empty for none.
        impossible: Split -> why it could not be made.
    """
    runs, settings = _briefly(runs)
    group_list = groups((run.name, run.evaluation.document) for run in runs)
    result = HtmlPage(_header(runs, group_list))
    _overview(result, group_list, settings, impossible or {})
    _data(result, runs[0].frames)
    _reliability(result, [group for group in group_list if group.reliability])
    if trials:
        result.add("The paper's trials", Prose(trials))
    shown_pairs: set[tuple[str, str]] = set()
    for run in runs:
        document = run.evaluation.document
        key = run.name, document["split"]["name"]
        if key in shown_pairs:
            continue  # of several seeds the first is shown; their figures are in the first table
        shown_pairs.add(key)
        _run(result, run, document)
    return result.text


def _header(runs: list[Scored], group_list: list[Group]) -> PageHeader:
    document = runs[0].evaluation.document
    stamp, checkpoint = document["provenance"], document["checkpoint"]["hash"][:12]
    return PageHeader(
        "Scores by split",
        summary(group_list),
        of=f"sensor {document['sensor']['name']}, dataset {document['dataset']['path']}",
        made=stamp.get("made_at", "")[:10],
        version=stamp["code_version"],
        lines=[document["statement"], f"The first network's checkpoint is {checkpoint}."],
        next=[_worst_first(document["dataset"]["path"], runs[0].folder)] if runs[0].folder else [],
    )


def _worst_first(dataset: str, folder: Path) -> str:
    """Return the command that lists a run's presses, the largest error first."""
    words = f"tacdata browse {quote(dataset)} --predictions {quote(str(folder))} --sort error --web"
    return f"its worst presses first: `{words}`"


def summary(group_list: list[Group]) -> str:
    """Return the scores in one sentence: the best network's errors, on how many frames."""
    if not group_list:
        return "No run has a labelled frame in contact, so there is no score."
    best = min(group_list, key=lambda group: group.mean("contact_rmse"))
    where, overlap = best.mean("centroid_error"), best.mean("iou")
    parts = [f"errs by {number(best.mean('contact_rmse'))} mm in depth where there is contact"]
    parts += [f"by {number(where, 2)} pixels in its place"] if np.isfinite(where) else []
    parts += [f"and overlaps it by {100 * overlap:.0f} %"] if np.isfinite(overlap) else []
    which = f"Of {len(group_list)} networks and splits the best, {best.name}" if len(group_list) > 1 else best.name
    return f"{which[:1].upper()}{which[1:]}, split {best.split}, {', '.join(parts)} ({best.frames:,} frames)."


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


def _overview(result: HtmlPage, group_list: list[Group], settings: list[str], impossible: dict[str, str]) -> None:
    heads = ["Network", "Split", "Seeds", "Frames", *(title(m) for m in METRICS), "ms a frame"]
    rows = [
        [
            group.name,
            group.split,
            len(group.seeds),
            group.frames,
            *(Cell(_cell(group, m), strong=group.stands_out(m)) for m in METRICS),
            f"{group.pace:.2f}",
        ]
        for group in group_list
    ]
    paper = ["The paper, its own data", "not said", "", "", *(number(TABLE_1[m]["mean"]) for m in METRICS), ""]
    notes = [
        *verdicts(group_list),
        *(f"Split {split} was not possible: {reason}" for split, reason in impossible.items()),
        *settings,
    ]
    result.add(
        "Splits, networks and seeds",
        Paragraph(
            "Mean over the frames in contact, then mean ± SD over seeds. Bold: better than the paper's mean and than "
            "every predictor without a network on the same split."
        ),
        Table(heads, [*rows, *_baseline_rows(group_list), paper]),
        Items(notes, note=True) if notes else None,
    )


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
    specimens = sorted({e.specimen for e in frames.episodes if e.specimen})
    speeds = [e.speed for e in frames.episodes if e.speed is not None]
    words = f"{len(frames.episodes)} episodes, {len(frames.taxels)} frames, dataset {frames.dataset_hash[:12]}"
    words += f", sensor {frames.sensor.name} {frames.sensor.content_hash[:12]}"
    words += f", specimens: {', '.join(specimens)}" if specimens else ""
    words += f", {min(speeds):g} to {max(speeds):g} mm/s" if speeds else ""
    places, depths = [], []
    for k, name in enumerate(sorted({e.indenter for e in frames.episodes})):
        spans = [e for e in frames.episodes if e.indenter == name]
        labels = [f"episode {e.number}, {e.depth:.2f} mm" for e in spans]
        color = COLORS[k % len(COLORS)]
        places.append(Series(name, [e.y for e in spans], color, "points", [e.x for e in spans], labels=labels))
        depths.append(Series(name, [e.depth for e in spans], color, "points", [e.number for e in spans], labels=labels))
    result.add(
        "Data",
        Paragraph(words + "."),
        Plot("nominal contact centres", "x [mm]", "y [mm]", places),
        Plot("nominal depths", "episode", "depth [mm]", depths, least=0.0),
    )


def _reliability(result: HtmlPage, group_list: list[Group]) -> None:
    if not group_list:
        return
    series = [Series("right", [0.4, 1.0], "grey", x=[0.4, 1.0])]
    for k, group in enumerate(group_list):
        levels = sorted(group.reliability)
        inside = [float(np.mean(group.reliability[level])) for level in levels]
        series.append(Series(f"{group.name}, {group.split}", inside, COLORS[k % len(COLORS)], "both", levels))
    words = (
        "Share of errors inside intervals that were calibrated on presses left out of training, against the share that "
        "should be inside: on the diagonal the uncertainty is right, below it too small."
    )
    drawn = Plot("share of errors inside their interval", "should be inside [1]", "is inside [1]", series, least=0.0)
    result.add("Reliability of the pixels' uncertainty", Paragraph(words), drawn)


def _run(result: HtmlPage, run: Scored, document: dict[str, Any]) -> None:
    split = document["split"]
    blocks: list[Any] = []
    cases = cases_of(run.evaluation.episodes)
    top = max((float(np.max([e.label[k], e.depth[k]])) for _, e, k, _ in cases), default=1.0)
    frames, pixels = run.frames, run.frames.sensor.map
    half_x, half_y = (n * pixels.pixel_pitch / 2 for n in pixels.shape)
    for name, episode, frame, error in cases:
        span, link = episode.span, f"{run.name} {split['name']} {name}"
        frame_rows = slice(span.start, span.stop)
        seconds = (frames.time_ns[frame_rows] - frames.time_ns[span.start]) * 1e-9
        for words, values in (
            ("label", episode.label[frame]),
            ("prediction", episode.depth[frame]),
            (f"error, contact RMSE {error:.3f} mm", np.abs(episode.depth[frame] - episode.label[frame])),
        ):
            extent = (-half_x, half_x, -half_y, half_y)
            caption = f"{name}, episode {span.number}: {words}"
            blocks.append(PixelMap(caption, values.T, "mm", 0.0, top, extent, [(span.x, span.y)], link=link))
        signals = frames.taxels[frame_rows]
        curves = [Series(f"taxel {k}", signals[:, k], COLORS[k % len(COLORS)]) for k in range(signals.shape[1])]
        caption = f"{name}, episode {span.number}: {span.indenter}, {span.depth:.2f} mm, at {seconds[frame]:.2f} s"
        blocks.append(Plot(caption, "time [s]", "signal [counts]", curves, seconds, most=MOST_SIGNALS))
    result.add(
        f"{run.name}, split {split['name']}, seed {split['seed']}",
        *blocks,
        Prose(markdown(document).split("\n", 2)[2]),
        Paragraph(f"Test episodes: {', '.join(map(str, split['episodes']))}.", note=True),
    )
