"""The paper's evaluations as a page of Markdown tables, our figures and the paper's."""

from __future__ import annotations

from typing import Any

from tacdata.training.reports.score_sheet import number, row, rule, spread
from tacdata.training.scoring import published


def markdown(document: dict[str, Any]) -> str:
    """Return the page of a protocols document (`schemas/protocols.schema.json`)."""
    network = document["network"]
    lines = ["# The paper's evaluations", "", document["statement"], ""]
    if "label_depth" in document or "label_position" in document:
        lines += ["## Labels against the prescribed contact (mm)", "", *_labels(document), ""]
    if network:
        lines += [f"Network `{network['name']}`, epoch {network['epoch']}, `{network['hash'][:12]}`.", ""]
    if "prediction_depth" in document:
        lines += [
            "## Predictions from measured inputs against the prescribed contact (mm)",
            "",
            *_physical(document),
            "",
        ]
    if "wearing" in document:
        lines += ["## Centroid-aligned IoU by participant", "", *_wearing(document["wearing"]), ""]
    lines.append(f"Dataset `{document['dataset']['hash'][:12]}`, code {document['provenance']['code_version']}.")
    return "\n".join(lines) + "\n"


HEADS = ["", "Mean ± SD", "Median", "P95", "n", "Paper: mean ± SD", "n"]


def _line(name: str, ours: dict[str, Any], paper: dict[str, Any] | None) -> str:
    counted = str(ours["count"]) if not ours["left_out"] else f"{ours['count']} of {ours['count'] + ours['left_out']}"
    theirs = ["–", "–"] if paper is None else [f"{number(paper['mean'])} ± {number(paper['sd'])}", str(paper["count"])]
    return row([name, spread(ours), number(ours["median"]), number(ours["p95"]), counted, *theirs])


def _labels(document: dict[str, Any]) -> list[str]:
    lines = [row(HEADS), rule(len(HEADS), 1)]
    if "label_depth" in document:
        lines.append(_line("Centre depth, depth trials", document["label_depth"], published.LABEL_DEPTH))
    for entry in document.get("label_position", []):
        threshold = entry["threshold_mm"]
        paper = published.LABEL_POSITION.get(threshold, {})
        words = f"Position above {threshold:g} mm"
        lines.append(_line(f"{words}, all trials", entry["all"], paper.get("all")))
        lines.append(
            _line(f"{words}, region not cut by the border", entry["not_truncated"], paper.get("not_truncated"))
        )
    return lines


def _physical(document: dict[str, Any]) -> list[str]:
    paper, position = published.PHYSICAL, document["prediction_position"]
    words = f"Position above {position['threshold_mm']:g} mm"
    lines = [
        row(HEADS),
        rule(len(HEADS), 1),
        _line("Depth at the contact centre, all trials", document["prediction_depth"], paper["centre_depth"]),
        _line(f"{words}, region not cut by the border", position["not_truncated"], paper["position"]),
        _line(f"{words}, all trials", position["all"], paper["position_all"]),
    ]
    if "prediction_depth_trials" in document:
        lines.append(_line("Depth at the contact centre, depth trials", document["prediction_depth_trials"], None))
    return lines


def _wearing(table: dict[str, Any]) -> list[str]:
    paper = published.WEARING
    lines = [row(["Participant", "Trials", "Mean ± SD"]), rule(3, 1)]
    lines += [row([p["participant"], str(p["trials"]), spread(p)]) for p in table["participants"]]
    means = [p["mean"] for p in table["participants"] if p["mean"] is not None]
    total = sum(p["trials"] for p in table["participants"])
    return [
        *lines,
        "",
        f"Participants' means {min(means):.3f} to {max(means):.3f}, overall {spread(table['overall'])} over "
        f"{len(means)} participants and {total} trials, regions above {table['threshold_mm']:g} mm. Paper: "
        f"{paper['lowest']:.3f} to {paper['highest']:.3f}, overall {paper['mean']:.3f} ± {paper['sd']:.3f} over "
        f"{paper['participants']} participants and {paper['trials']} trials.",
    ]
