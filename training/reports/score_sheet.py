"""Scores as a page of Markdown tables."""

from __future__ import annotations

import math
from typing import Any

from tacdata.training.scoring.baselines import ahead
from tacdata.training.scoring.evaluate import METRICS
from tacdata.training.scoring.published import TABLE_1

RULES = (
    "Contact-region RMSE is defined where the label has contact, the centroid error where label and "
    "prediction both have, IoU where either has (0 if only one). Undefined frames are left out and counted. "
    "SD is the sample standard deviation."
)


def markdown(document: dict[str, Any]) -> str:
    """Return the page of a scores document (`schemas/scores.schema.json`)."""
    frames, split = document["frames"], document["split"]
    lines = [
        *_ahead(document),
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
        "## By the largest labelled depth, frames in contact (mean)",
        "",
        *_depths(document.get("depths", [])),
        "",
        *_contacts(document.get("contacts")),
        "## Against the prescribed contact, one value a press at full depth (mean ± SD)",
        "",
        *_prescribed(document["prescribed"]),
        "",
        *_proportion("Success", document["success"]),
        "",
        *_reliability(document),
        f"Checkpoint `{document['checkpoint']['hash'][:12]}`, dataset `{document['dataset']['hash'][:12]}`, "
        f"sensor {document['sensor']['name']} `{document['sensor']['hash'][:12]}`, "
        f"code {document['provenance']['code_version']}.",
    ]
    return "\n".join(lines) + "\n"


def number(value: float | None, digits: int = 3) -> str:
    """Return a value in print, or a dash if there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


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
    lines = [row(columns + paper), rule(len(columns + paper), 2)]
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
        lines.append(row(cells + published))
    return lines


def _ahead(document: dict[str, Any]) -> list[str]:
    """Return a first line that names the baselines that are ahead of the network; empty if none is."""
    words = []
    for name, table in ahead(document).items():
        cells = [f"{title(metric)} {number(its)} for {number(score)}" for metric, (its, score) in table.items()]
        words.append(f"{name} in {', '.join(cells)}")
    return [f"**A predictor without a network is ahead (median):** {'; '.join(words)}.", ""] if words else []


def _baselines(document: dict[str, Any]) -> list[str]:
    heads = ["Predictor", *(title(metric) for metric in METRICS)]
    rows = {f"network {document['checkpoint']['name']}": document["contact_frames"], **document["baselines"]}
    lines = [
        "## Compared with predictors without a network, frames in contact (median)",
        "",
        row(heads),
        rule(len(heads), 1),
    ]
    lines += [row([name, *(number(table[m]["median"]) for m in METRICS)]) for name, table in rows.items()]
    return [*lines, "", "mean: the mean training label; linear: ridge regression on the taxels of the one frame.", ""]


def _reliability(document: dict[str, Any]) -> list[str]:
    uncertainty = document.get("uncertainty")
    if uncertainty is None:
        return []
    lines = [
        "## Reliability of the pixels' intervals",
        "",
        row(["Should lie inside (%)", "Does (%)", "Mean width (mm)"]),
    ]
    lines.append(rule(3, 0))
    for entry in uncertainty["levels"]:
        lines.append(
            row([f"{100 * entry['level']:.0f}", f"{100 * entry['inside']:.1f}", number(entry["mean_width_mm"])])
        )
    return [*lines, "", f"Counted is the {uncertainty['definition']}.", ""]


def _indenters(rows: list[dict[str, Any]]) -> list[str]:
    heads = ["Indenter", "Episodes", "Frames", *(title(m) for m in METRICS)]
    lines = [row(heads), rule(len(heads), 1)]
    for entry in rows:
        values = [number(entry["metrics"][m]["median"]) for m in METRICS]
        lines.append(row([entry["indenter"], str(entry["episodes"]), str(entry["frames"]), *values]))
    return lines


def _depths(rows: list[dict[str, Any]]) -> list[str]:
    heads = ["Deepest pixel (mm)", "Frames", *(title(m) for m in METRICS)]
    lines = [row(heads), rule(len(heads), 1)]
    for entry in rows:
        upper = f" to {entry['up_to_mm']:g}" if entry["up_to_mm"] is not None else " and deeper"
        values = [number(entry["metrics"][m]["mean"]) for m in METRICS]
        lines.append(row([f"{entry['above_mm']:g}{upper}", str(entry["frames"]), *values]))
    return lines


def _contacts(contacts: dict[str, Any] | None) -> list[str]:
    if contacts is None:
        return []
    heads = ["Contacts at once", "Presses", "All found (%)", "Missed", "Invented", "Centroid error (px): median", "P90"]
    lines = ["## Single contacts, one value a press at full depth", "", row(heads), rule(len(heads), 1)]
    for entry in contacts["presses"]:
        words = "one"
        if entry["contacts"] == "several":
            upper = f" to {entry['up_to_mm']:g}" if entry["up_to_mm"] is not None else " or more"
            words = f"several, {entry['above_mm']:g}{upper} mm apart"
        all_found, error = entry["all_found"], entry["centroid_error"]
        values = [f"{100 * all_found['count'] / all_found['of']:.1f}", str(entry["missed"]), str(entry["invented"])]
        lines.append(row([words, str(entry["presses"]), *values, number(error["median"], 2), number(error["p90"], 2)]))
    words = (
        f"A contact is a hill of depth that rises by {100 * contacts['prominence']:g} % of its depth. Distances are "
        f"between labelled centroids. Contacts more than {contacts['reach_mm']:g} mm apart are not matched."
    )
    if rule_of := contacts.get("predicted"):
        words += (
            f" A predicted hill stands out by {100 * rule_of['prominence_long']:g} % in a region at least "
            f"{rule_of['long']:g} times as long as wide, and by {100 * rule_of['prominence_round']:g} % in another."
        )
    return [*lines, "", words, ""]


def _prescribed(table: dict[str, Any]) -> list[str]:
    titles = {
        "centre_depth": "Depth at the nominal centre, absolute error (mm)",
        "position": "Position of the region's centroid, region not cut by the border (mm)",
        "position_all": "Position of the region's centroid, all presses (mm)",
    }
    heads = ["", "Prediction", "n", "Paper", "n", "Label", "n", "Paper", "n"]
    lines = [row(heads), rule(len(heads), 1)]
    for key, name in titles.items():
        cells = [name]
        for source in ("prediction", "label"):
            ours, paper = table[source][key], table[source]["paper"][key]
            cells += [spread(ours), _defined(ours), spread(paper), str(paper["count"])]
        lines.append(row(cells))
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


def row(cells: list[str]) -> str:
    """Return a line of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def rule(columns: int, text_columns: int) -> str:
    """Return the line below a table's head; the first ``text_columns`` columns are aligned left, the others right."""
    return "|" + "|".join([" --- "] * text_columns + [" ---: "] * (columns - text_columns)) + "|"
