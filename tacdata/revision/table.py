"""The gap before and after as a table, in Markdown and CSV."""

from __future__ import annotations

import csv
import io
from typing import Any

HEAD = ("where", "episodes", "before", "after", "share closed")


def rows(revision: dict[str, Any]) -> list[tuple[str, int, float, float, float | None]]:
    """Return the lines: sealed episodes, the worst of them, every group that was left out."""
    gap = revision["gap"]
    if gap is None:
        return []
    found = [("sealed episodes", gap["sealed"]), (f"worst: {gap['worst']['name']}", gap["worst"])]
    found += [(f"left out: {c['name']}", c) for c in gap["elsewhere"]]
    return [(name, c["episodes"], c["before"], c["after"], _closed(c)) for name, c in found]


def _closed(change: dict[str, Any]) -> float | None:
    above = change["before"] - 1.0
    return (change["before"] - change["after"]) / above if above > 1e-3 else None


def markdown(revision: dict[str, Any]) -> str:
    """Return the table in Markdown; mean squares over the noise floor."""
    lines = [f"| {' | '.join(HEAD)} |", "|---|---:|---:|---:|---:|"]
    for name, count, before, after, closed in rows(revision):
        lines.append(f"| {name} | {count} | {before:.4g} | {after:.4g} | {'' if closed is None else f'{closed:.3f}'} |")
    return "\n".join(lines) + "\n"


def as_csv(revision: dict[str, Any]) -> str:
    """Return the table as CSV."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(HEAD)
    for name, count, before, after, closed in rows(revision):
        writer.writerow((name, count, f"{before:.6g}", f"{after:.6g}", "" if closed is None else f"{closed:.6g}"))
    return buffer.getvalue()
