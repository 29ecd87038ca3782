"""The gap before and after as a table, in Markdown and CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

HEAD = ("where", "episodes", "before", "after", "share closed")


def rows(revision: dict[str, Any]) -> list[tuple[str, int, float, float, float | None]]:
    """Return the rows: sealed episodes, the worst of them, every group that was left out."""
    gap = revision["gap"]
    if gap is None:
        return []
    entries = [("sealed episodes", gap["sealed"]), (f"worst: {gap['worst']['name']}", gap["worst"])]
    entries += [(f"left out: {c['name']}", c) for c in gap["elsewhere"]]
    entries += [(f"sealed, {c['name']}", c) for c in gap.get("slices", ())]
    return [(name, c["episodes"], c["before"], c["after"], _closed(c)) for name, c in entries]


def _closed(change: dict[str, Any]) -> float | None:
    above = change["before"] - 1.0
    return (change["before"] - change["after"]) / above if above > 1e-3 else None


def markdown(revision: dict[str, Any]) -> str:
    """Return the table in Markdown; mean squares in units of the noise floor."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|---:|---:|---:|---:|"]
    for name, count, initial, final, closed in rows(revision):
        lines.append(
            f"| {name} | {count} | {initial:.4g} | {final:.4g} | {'' if closed is None else f'{closed:.3f}'} |"
        )
    return "\n".join([*lines, *_tips(revision), *_networks(revision)]) + "\n"


def _tips(revision: dict[str, Any]) -> list[str]:
    tips = revision.get("tips") or []
    if not tips:
        return []
    lines = ["", "| tip error [mm] | reference | episodes | before | after | better | worse |"]
    lines.append("|---|---|---:|---:|---:|---:|---:|")
    for t in tips:
        lines.append(
            f"| {t['session']} | {t['against']} | {t['episodes']} | {t['before']:.4f} | {t['after']:.4f} "
            f"| {t['better']} | {t['worse']} |"
        )
    return lines


def _networks(revision: dict[str, Any]) -> list[str]:
    trained = revision.get("retrained")
    if not trained:
        return []
    lines = ["", f"{in_words(trained)}", "", "| network | unit | before | after |", "|---|---|---:|---:|"]
    for m in trained["metrics"]:
        values = ("–" if m[side] is None else f"{m[side]:.4g}" for side in ("before", "after"))
        lines.append(f"| {m['title']} | {m['unit']} | {' | '.join(values)} |")
    return lines


def in_words(trained: dict[str, Any]) -> str:
    """Describe the data on which two networks were trained and scored."""
    learnt = {
        "labels": "both learnt from measured readings, with labels of either model; scored on labels of the model "
        "after, which are right as far as the effect is",
        "readings": "both learnt from readings that either model predicts; scored on measured readings",
    }[trained["by"]]
    return (
        f"Networks of {trained['epochs']} epochs, {trained['episodes']} episodes that neither saw "
        f"({trained['frames']} frames in contact): {learnt}."
    )


def as_csv(revision: dict[str, Any]) -> str:
    """Return the table as CSV."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(HEAD)
    for name, count, initial, final, closed in rows(revision):
        writer.writerow((name, count, f"{initial:.6g}", f"{final:.6g}", "" if closed is None else f"{closed:.6g}"))
    return buffer.getvalue()
