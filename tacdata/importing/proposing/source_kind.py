"""A kind of file with its name in the mapping and a role for each column."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tacdata.importing.plausibility.codes import table_without_codes
from tacdata.importing.proposing.description import FoundKind
from tacdata.importing.proposing.drives import are_halves, stand_in
from tacdata.importing.proposing.file_kinds import INSIDE, listed
from tacdata.importing.proposing.roles import is_whole, roles_of
from tacdata.importing.proposing.shapes import varying
from tacdata.importing.source_table import SourceTable

SHORT = 0.2
"""Largest share of a recording's rows that a table of results has [1]."""


@dataclass(frozen=True)
class SourceKind:
    """Files of one kind, as a mapping will name them."""

    alias: str
    """Name under ``files``."""
    kind: str
    """Path with # in place of what differs, and the table inside it."""
    found: FoundKind
    roles: dict[str, list[str]]
    """Role -> columns; ``channels`` are those of no other."""

    @property
    def table(self) -> SourceTable:
        """The first file's columns."""
        return self.found.table

    @property
    def channels(self) -> list[str]:
        """Columns that are readings."""
        return self.roles["channels"]


def source_kinds(found: dict[str, FoundKind]) -> tuple[tuple[SourceKind, ...], tuple[str, ...]]:
    """Return the kinds with their names and roles, and what was left out or replaced, as sentences."""
    bare = {
        kind: replace(entry, table=table_without_codes(entry.table, list(entry.table.columns), kind)[0])
        for kind, entry in found.items()
    }
    kept, notes = _without_summaries(bare)
    aliases: dict[str, str] = {}
    for kind in kept:
        path, _, inside = kind.partition(INSIDE)
        alias = re.sub(r"\W+", "_", (inside or Path(path).stem).lower()).strip("_") or "data"
        # Aliases are keys of the mapping: two folders may hold files of one name.
        while alias in aliases:
            alias += "_"
        aliases[alias] = kind
    roles = {alias: roles_of(kept[kind].table) for alias, kind in aliases.items()}
    if not any(columns["channels"] for columns in roles.values()):
        # Nothing else was read: the load cell is the sensor.
        for role in ("torque", "force"):
            for columns in roles.values():
                columns["channels"] = columns.pop(role, columns["channels"])
    question = stand_in({alias: kept[kind].table for alias, kind in aliases.items()}, roles)
    kinds, halves = [], []
    for alias, kind in aliases.items():
        columns, note = _whole_strokes(kept[kind].table, roles[alias])
        kinds.append(SourceKind(alias, kind, kept[kind], columns))
        halves.append(note)
    return tuple(kinds), tuple(filter(None, (*notes, question, *halves)))


def _without_summaries(kinds: dict[str, FoundKind]) -> tuple[dict[str, FoundKind], list[str]]:
    """Return kinds of files without tables of results, of few rows and no time, and a remark on each of these."""
    roles = {kind: roles_of(entry.table) for kind, entry in kinds.items()}
    timed = [kind for kind, columns in roles.items() if columns.get("time")]
    if not any(is_whole(roles[kind]) for kind in timed) and len(timed) < 2:
        return kinds, []
    rows = float(np.median([kinds[kind].table.rows for kind in timed]))
    short = [kind for kind in kinds if kind not in timed and kinds[kind].table.rows < SHORT * rows]
    remarks = [
        f"{kind.replace(INSIDE, ' ')}: {kinds[kind].table.rows} rows without a time: taken for results, and not used"
        for kind in short
    ]
    return {kind: entry for kind, entry in kinds.items() if kind not in short}, remarks


def widest(kinds: tuple[SourceKind, ...]) -> SourceKind:
    """Return the kind with the most channels that change."""
    return max(kinds, key=lambda kind: (varying(kind.table, kind.channels), "value" in kind.roles))


def _whole_strokes(table: SourceTable, columns: dict[str, list[str]]) -> tuple[dict[str, list[str]], str]:
    """Return the roles without a column of trials that marks halves of strokes, and a remark on it."""
    moving = columns.get("depth") or columns.get("z")
    if not moving or "trial" not in columns or moving[0] not in table.columns:
        return columns, ""
    name, labels = columns["trial"][0], table.column(columns["trial"][0]).astype(str)
    if not are_halves(labels, table.column(moving[0]).astype(float)):
        return columns, ""
    words = listed(list(dict.fromkeys(labels.tolist()))[:3])
    remark = f"{name} distinguishes the way in from the way back ({words}): trials are cut by depth instead"
    return {role: names for role, names in columns.items() if role != "trial"}, remark
