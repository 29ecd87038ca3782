"""Scores as a page of Markdown tables."""

from __future__ import annotations

from typing import Any

from training.evaluate import METRICS
from training.published import TABLE_1

RULES = (
    "Contact-region RMSE is defined where the label has contact, the centroid error where label and "
    "prediction both have, IoU where either has (0 if only one). Undefined frames are left out and counted. "
    "SD is the sample standard deviation."
)


def markdown(document: dict[str, Any]) -> str:
    """Return the page of a scores document (`schemas/scores.schema.json`)."""
    frames, split = document["frames"], document["split"]
    lines = [
        f"# Scores of network `{document['checkpoint']['name']}`",
        "",
        document["statement"],
        "",
        f"Split `{split['name']}` (seed {split['seed']}): {len(split['episodes'])} {split['part']} episodes, "
        f"{frames['scored']} frames, {frames['in_contact']} of them in contact "
        f"(label above {document['contact_threshold_mm']:g} mm); "
        f"{frames['left_out_as_invalid']} invalid frames left out. "
        f"Best epoch {document['checkpoint']['epoch']}; {document['checkpoint']['parameters']:,} parameters; "
        f"{document['inference_ms_per_frame']:.2f} ms a frame on one CPU core.",
        "",
        "## Prediction against label, frames in contact",
        "",
        *_agreement(document["contact_frames"], with_paper=True),
        "",
        RULES,
        "",
        *_proportion("Missed contact", document["missed_contact"]),
        *_proportion("False contact", document["false_contact"]),
        "",
        "## Prediction against label, all frames",
        "",
        *_agreement(document["all_frames"], with_paper=False),
        "",
        *(_baselines(document) if document["baselines"] else []),
        "## By indenter, frames in contact (median)",
        "",
        *_indenters(document["indenters"]),
        "",
        "## Against the prescribed contact, one value a press at full depth (mean ± SD)",
        "",
        *_prescribed(document["prescribed"]),
        "",
        *_proportion("Success", document["success"]),
        "",
        f"Checkpoint `{document['checkpoint']['hash'][:12]}`, dataset `{document['dataset']['hash'][:12]}`, "
        f"sensor {document['sensor']['name']} `{document['sensor']['hash'][:12]}`, "
        f"code {document['provenance']['code_version']}.",
    ]
    return "\n".join(lines) + "\n"


def number(value: float | None, digits: int = 3) -> str:
    """Return a value in print, or a dash if there is none."""
    return "–" if value is None else f"{value:.{digits}f}"


def spread(summary: dict[str, Any]) -> str:
    """Return "mean ± SD" of a summary."""
    return f"{number(summary['mean'])} ± {number(summary['sd'])}"


def title(metric: str) -> str:
    """Return a metric's name with its unit."""
    _, name, unit = METRICS[metric]
    return name if unit == "1" else f"{name} ({unit})"


def _agreement(table: dict[str, Any], with_paper: bool) -> list[str]:
    columns = ["Category", "Metric", "Median", "P90", "Mean ± SD", "Left out"]
    paper = ["Paper: median", "P90", "Mean ± SD"] if with_paper else []
    lines = [_row(columns + paper), _rule(len(columns + paper), 2)]
    for metric, (category, _, _) in METRICS.items():
        ours, theirs = table[metric], TABLE_1[metric]
        cells = [
            category,
            title(metric),
            number(ours["median"]),
            number(ours["p90"]),
            spread(ours),
            f"{ours['left_out']} of {ours['left_out'] + ours['count']}",
        ]
        published = [number(theirs["median"]), number(theirs["p90"]), spread(theirs)] if with_paper else []
        lines.append(_row(cells + published))
    return lines


def _baselines(document: dict[str, Any]) -> list[str]:
    heads = ["Predictor", *(title(metric) for metric in METRICS)]
    rows = {f"network {document['checkpoint']['name']}": document["contact_frames"], **document["baselines"]}
    lines = [
        "## Beside predictors without a network, frames in contact (median)",
        "",
        _row(heads),
        _rule(len(heads), 1),
    ]
    lines += [_row([name, *(number(table[m]["median"]) for m in METRICS)]) for name, table in rows.items()]
    return [
        *lines,
        "",
        "mean: the mean training label; linear: ridge regression on the taxels of the one frame.",
        "",
    ]


def _indenters(rows: list[dict[str, Any]]) -> list[str]:
    lines = [
        _row(["Indenter", "Episodes", "Frames", *(title(m) for m in METRICS)]),
        _rule(3 + len(METRICS), 1),
    ]
    for row in rows:
        values = [number(row["metrics"][m]["median"]) for m in METRICS]
        lines.append(_row([row["indenter"], str(row["episodes"]), str(row["frames"]), *values]))
    return lines


def _prescribed(table: dict[str, Any]) -> list[str]:
    titles = {
        "centre_depth": "Depth at the nominal centre, absolute error (mm)",
        "position": "Position of the region's centroid, region not cut by the border (mm)",
        "position_all": "Position of the region's centroid, all presses (mm)",
    }
    heads = ["", "Prediction", "n", "Paper", "n", "Label", "n", "Paper", "n"]
    lines = [_row(heads), _rule(len(heads), 1)]
    for key, name in titles.items():
        cells = [name]
        for source in ("prediction", "label"):
            ours, paper = table[source][key], table[source]["paper"][key]
            cells += [spread(ours), _defined(ours), spread(paper), str(paper["count"])]
        lines.append(_row(cells))
    return lines


def _defined(summary: dict[str, Any]) -> str:
    total = summary["count"] + summary["left_out"]
    return str(total) if not summary["left_out"] else f"{summary['count']} of {total}"


def _proportion(name: str, entry: dict[str, Any]) -> list[str]:
    if not entry["of"]:
        return [f"- {name}: no such case. Counted are {entry['definition']}."]
    low, high = entry["wilson_95"]
    return [
        f"- {name}: {entry['count']} of {entry['of']} ({100 * entry['proportion']:.1f} %, 95 % Wilson "
        f"interval {100 * low:.1f} to {100 * high:.1f} %). Counted are {entry['definition']}."
    ]


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _rule(columns: int, left: int) -> str:
    return "|" + "|".join([" --- "] * left + [" ---: "] * (columns - left)) + "|"
