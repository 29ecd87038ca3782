"""Files and columns without a role in a recording, as tables of results and settings of a machine."""

from __future__ import annotations

from typing import Any

import numpy as np

from tacdata.importing.proposing.description import FoundKind
from tacdata.importing.proposing.file_kinds import INSIDE
from tacdata.importing.proposing.roles import is_whole, roles_of
from tacdata.importing.source_table import SourceTable

SHORT = 0.2
"""Largest share of a recording's rows that a table of results has [1]."""
IDLE = ("idle", "setting", "state", "counter", "orientation", "joint", "derived")
"""Roles of columns that are no channels of a sensor."""


def without_summaries(kinds: dict[str, FoundKind], notes: list[str]) -> dict[str, FoundKind]:
    """Return kinds of files without tables of results, of few rows and no time, which ``notes`` lists."""
    roles = {kind: roles_of(entry.table) for kind, entry in kinds.items()}
    timed = [kind for kind, columns in roles.items() if columns.get("time")]
    if not any(is_whole(roles[kind]) for kind in timed) and len(timed) < 2:
        return kinds
    rows = float(np.median([kinds[kind].table.rows for kind in timed]))
    short = [kind for kind in kinds if kind not in timed and kinds[kind].table.rows < SHORT * rows]
    notes += [
        f"{kind.replace(INSIDE, ' ')}: {kinds[kind].table.rows} rows without a time: taken for results, and not used"
        for kind in short
    ]
    return {kind: entry for kind, entry in kinds.items() if kind not in short}


def leave_unused_out(
    document: dict[str, Any],
    aliases: dict[str, str],
    kinds: dict[str, FoundKind],
    roles: dict[str, dict[str, list[str]]],
    notes: list[str],
) -> None:
    """Take files without a role out of the mapping, and list them and the columns that measure nothing."""
    sections = [document["taxels"], document.get("position", {}), *document.get("measured", {}).values()]
    specimen = document.get("press", {}).get("specimen", {})
    used = {entry.get("file") for entry in (*sections, specimen)}
    for alias in [alias for alias in aliases if alias not in used]:
        del document["files"][alias]
        kind = kinds[aliases[alias]]
        columns = listed((roles[alias]["channels"] or list(kind.table.columns))[:4])
        notes.append(f"{kind.path} is not used: is {columns} needed?")
    idle = [name for role in IDLE for name in roles[document["taxels"]["file"]].get(role, [])]
    if idle:
        more = f" and {len(idle) - 12} more" if len(idle) > 12 else ""
        notes.append(f"no channels but settings, states, counters or constants: {', '.join(idle[:12])}{more}")


def unread(table: SourceTable, roles: dict[str, list[str]], notes: list[str]) -> list[str | int]:
    """Return the columns of text that have no role, as channels: the import then says why they are no numbers."""
    used = {name for names in roles.values() for name in names}
    texts = [name for name in table.columns if name not in used and table.column(name).dtype == object]
    notes.append("no column is a channel: " + (f"{listed(texts[:4])} hold text" if texts else "which are readings?"))
    return [*texts] or [0]


def listed(words: list[str]) -> str:
    """Return words as a list in a sentence: a, b and c."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
