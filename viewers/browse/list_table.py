"""A list of episodes as lines of text."""

from tacdata.viewers.browse.episode_list import SHOWN, UNITS, Entry, EpisodeList


def list_table(listed: EpisodeList, limit: int, scored: bool) -> str:
    """Return a heading and a line an episode, columns that are empty for all left out.

    Args:
        listed: The episodes, in order.
        limit: Lines at most.
        scored: Whether errors of a network were asked for.
    """
    entries = listed.entries[:limit]
    columns = [c for c in SHOWN if any(getattr(e, c) not in (None, "") for e in entries) or (scored and c == "error")]
    heads = [f"{c} [{UNITS[c]}]" if c in UNITS else c for c in columns]
    rows = [[said(entry, c) for c in columns] for entry in entries]
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    lines = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in (heads, *rows)]
    flagged = sum(bool(e.flag) for e in listed.entries)
    remainder = len(listed.entries) - len(entries)
    lines.append("")
    lines.append(
        f"{len(listed.entries)} episodes of {listed.root}"
        + (f", {flagged} flagged" if flagged else "")
        + (f"; {remainder} more, see them with --most" if remainder else "")
    )
    return "\n".join(lines)


def said(entry: Entry, column: str) -> str:
    """Return a value as it is printed; a dash if unknown."""
    value = getattr(entry, column)
    if value is None:
        return "–"
    if column == "error":
        return f"{value:.4f}"
    if column in ("centroid", "iou"):
        return f"{value:.3f}"
    if column == "quality":
        return f"{100 * value:.0f} %"
    return f"{value:g}" if isinstance(value, float) else str(value)
