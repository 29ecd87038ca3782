"""Proposes a mapping for foreign files, and asks a person for values that the files lack."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import schemas
from tacdata.chain.at_rest import below_zero, zero_side
from tacdata.errors import FormatError
from tacdata.importing.mapping import SourceClock
from tacdata.importing.plausibility.codes import table_without_codes
from tacdata.importing.proposing.description import FoundKind
from tacdata.importing.proposing.drives import are_halves, is_copy, length_of, rate_of, stand_in
from tacdata.importing.proposing.file_kinds import INSIDE, pattern
from tacdata.importing.proposing.roles import roles_of
from tacdata.importing.proposing.shapes import counting_column, varying
from tacdata.importing.proposing.stream_clocks import SHORT, own_clocks
from tacdata.importing.proposing.strokes import CLEAR, PressingAxis, pressing_axis
from tacdata.importing.proposing.unused import leave_unused_out, listed, unread, without_summaries
from tacdata.importing.source_table import SourceTable, unit_of
from tacdata.importing.times import layouts_of, times
from tacdata.importing.units import factor, plain

SPECIMEN = re.compile(r"(?:specimen|spec|sample|material|coupon|probe)[-_ ]?$", re.IGNORECASE)
"""Text in a path before the number or the name of a specimen."""
PLACE = re.compile(r"(?<![A-Za-z])([xyXY])[-_=]?$")
"""Text in a path before a place."""
SHORTEST = 0.02
"""Strokes below are hardly in mm [mm]."""
MATERIAL = re.compile(
    r"ecoflex|dragon|pdms|sylgard|silicon|rubber|latex|vhb|tpu|foam|gel|agilus|ninja|elast|neopren|solaris|smooth",
    re.IGNORECASE,
)
"""Words of folders that name materials of soft sensors."""


@dataclass(frozen=True)
class Proposal:
    """A mapping to start from."""

    mapping: dict[str, Any]
    questions: tuple[str, ...]
    """Values that a person has to give or to check, as sentences."""


def proposed_mapping(source: Path, kinds: dict[str, FoundKind]) -> Proposal:
    """Return a mapping for the kinds of files, as far as names and values allow, and its open questions."""
    notes: list[str] = []
    bare = {kind: table_without_codes(entry.table, list(entry.table.columns), kind)[0] for kind, entry in kinds.items()}
    kinds = {kind: replace(entry, table=bare[kind]) for kind, entry in kinds.items()}
    kinds = without_summaries(kinds, notes)
    aliases: dict[str, str] = {}
    for kind in kinds:
        path, _, inside = kind.partition(INSIDE)
        alias = re.sub(r"\W+", "_", (inside or Path(path).stem).lower()).strip("_") or "data"
        # Aliases are keys of the mapping: two folders may hold files of one name.
        while alias in aliases:
            alias += "_"
        aliases[alias] = kind
    tables = {alias: kinds[kind].table for alias, kind in aliases.items()}
    roles = {alias: roles_of(table) for alias, table in tables.items()}
    if not any(columns["channels"] for columns in roles.values()):
        # Nothing else was read: the load cell is the sensor.
        for columns in roles.values():
            columns["channels"] = columns.pop("force", [])
    wide = max(aliases, key=lambda alias: (varying(tables[alias], roles[alias]["channels"]), "value" in roles[alias]))
    notes += [question] if (question := stand_in(tables, roles)) else []
    for alias, columns in roles.items():
        _whole_strokes(tables[alias], columns, notes)
    document: dict[str, Any] = {
        "version": schemas.version("import_mapping"),
        "name": source.stem,
        "source": "say where the data come from",
        "files": {alias: _file(kind, kinds[kind], roles[alias], notes) for alias, kind in aliases.items()},
        "sensor": {"name": source.stem},
        "taxels": {
            "file": wide,
            "columns": _short(roles[wide]["channels"]) or unread(tables[wide], roles[wide], notes),
        },
    }
    if "value" in roles[wide]:
        document["taxels"] = {
            "file": wide,
            "long": {"channel": roles[wide]["number"][0], "value": roles[wide]["value"][0]},
        }
    elif roles[wide].get("time") and (counter := counting_column(tables[wide], roles[wide])):
        document["taxels"]["counter"] = counter
    units = {plain(tables[wide].units.get(name, "")) for name in roles[wide]["channels"]}
    if len(units) == 1 and units != {""}:
        document["taxels"]["unit"] = units.pop()
    _place(document, tables, roles, notes)
    for alias, columns in roles.items():
        if "trial" in columns:
            document["trials"] = {"column": columns["trial"][0]}
        if specimen := _specimen(alias, aliases[alias], kinds[aliases[alias]], columns, notes):
            document.setdefault("press", {"specimen": specimen})
    for key, part in _place_in_path(aliases[wide]).items():
        if key not in document.get("position", {}):
            document.setdefault("press", {})[key] = {"part": part}
    _unnamed(tables[wide], roles[wide], notes)
    own_clocks(document, tables, roles, notes)
    leave_unused_out(document, aliases, kinds, roles, notes)
    return Proposal(document, tuple(notes))


def _place(
    document: dict[str, Any], tables: dict[str, SourceTable], roles: dict[str, dict[str, list[str]]], notes: list[str]
) -> None:
    """Add position, gauge, force and temperature; cut trials where one file holds several."""
    # A height that never changes, as of an image, is a position only where nothing else is.
    keys = ("depth", "z", "x", "y")
    axes = {alias: [name for key in keys for name in columns.get(key, [])] for alias, columns in roles.items()}
    for alias in sorted(roles, key=lambda name: (not varying(tables[name], axes[name]), -len(axes[name]))):
        columns, table = roles[alias], tables[alias]
        if "position" not in document and ("depth" in columns or "z" in columns):
            axis_keys = ("x", "y", "depth") if "depth" in columns else ("x", "y", "z")
            entry = {key: _axis(table, columns[key][0]) for key in axis_keys if key in columns}
            document["position"] = {"file": alias} | entry
            unsaid = [columns[key][0] for key in axis_keys if key in columns and "unit" in entry[key]]
            if "by_shape" in columns:
                notes.append(
                    f"{columns['depth'][0]}: taken for the position by its shape: it is smooth, comes back, and the "
                    "readings follow it"
                )
            if "error" in columns and columns.get("depth") == columns.get("set_point", [None])[:1]:
                document["position"]["depth"] = _without_error(table, columns, notes)
            if "stand_in" in columns:
                entry["depth"]["unit"] = length_of(table, columns["stand_in"][0])
            elif unsaid:
                unit = _length(table, entry, columns[axis_keys[-1]][0])
                notes.append(f"{listed(unsaid)}: no unit is given; {unit} is a guess")
            _motion(document, table, columns, roles[document["taxels"]["file"]]["channels"], notes)
        lengths = columns.get("depth", [])
        lengths = lengths[:1] + [name for name in lengths[1:] if not is_copy(table, lengths[0], name)]
        if len(lengths) > 1 and "displacement" not in document.get("measured", {}):
            # A second length is a gauge in addition to the drive; it separates compliance from the skin's deformation.
            gauge = {"file": alias, "columns": lengths[1:2], "unit": plain(table.units.get(lengths[1], "")) or "mm"}
            document.setdefault("measured", {})["displacement"] = gauge
        for key in ("force", "temperature"):
            if key in columns and key not in document.get("measured", {}):
                unit = table.units.get(columns[key][0])
                entry = {"file": alias, "columns": columns[key], **({"unit": plain(unit)} if unit else {})}
                document.setdefault("measured", {})[key] = entry
    if "position" not in document:
        notes.append("no column is named as a position or a depth: give position, or schedule")


def _whole_strokes(table: SourceTable, columns: dict[str, list[str]], notes: list[str]) -> None:
    """Let no column separate trials that marks halves of strokes."""
    moving = columns.get("depth") or columns.get("z")
    if not moving or "trial" not in columns or "[" in moving[0]:
        return
    labels = table.column(columns["trial"][0]).astype(str)
    if are_halves(labels, table.column(moving[0]).astype(float)):
        (name,) = columns.pop("trial")[:1]
        words = listed(list(dict.fromkeys(labels.tolist()))[:3])
        notes.append(f"{name} tells the way in from the way back ({words}): trials are cut by depth instead")


def _motion(
    document: dict[str, Any], table: SourceTable, columns: dict[str, list[str]], channels: list[str], notes: list[str]
) -> None:
    """Set the sign of the pressing axis, tell a machine's height from a depth, and cut trials by pauses or presses."""
    name, position = columns.get("depth", columns.get("z", []))[0], document["position"]
    clock = document["files"][position["file"]]["time"]
    try:
        time_ns, _ = times(table, SourceClock(**clock), "")
        axis = table.column(name).astype(float)
        motion = pressing_axis(time_ns, axis, _deviation(table, channels, axis))
    except (FormatError, ValueError):
        return  # reported where the clock was read
    is_depth = "depth" in columns
    if is_depth and motion.lifted:
        position["z"], is_depth = position.pop("depth"), False
    elif not is_depth and motion.sign > 0 and motion.at_zero and set(position) == {"file", "z"}:
        position["depth"], is_depth = position.pop("z"), True
    if motion.sign * (1 if is_depth else -1) < 0:
        position["depth" if is_depth else "z"]["scale"] = -1.0
        way = "falls" if motion.sign < 0 else "grows"
        notes.append(f"{name}: it {way} into the skin, so its sign is turned (scale: -1)")
    if is_depth:
        _from_the_lowest(position["depth"], table, name, channels, notes)
    if not is_depth and motion.at_zero:
        document["contact"] = {"z": 0.0, "known_from": "the zero of the machine"}
        notes.append(f"{name}: its zero is taken for the height at which the skin is touched (contact: {{z: 0}})")
    elif not is_depth and "stand_in" in columns:
        notes.append(f"{name}: it does not rest at zero; depth is counted from where each trial is at rest")
    elif not is_depth:
        notes.append(
            f"{name}: a machine's height; where does it touch the skin? Give contact: {{z: ...}}, else depth is "
            "counted from the highest position of each trial"
        )
    if "trial" not in columns and "trials" not in document:
        entry = position["depth" if is_depth else "z"]
        above = motion.above * _in_mm(table, name, entry)
        _cut(document, motion, above if is_depth else None, notes)


def _from_the_lowest(
    entry: dict[str, Any], table: SourceTable, name: str, channels: list[str], notes: list[str]
) -> None:
    """Count a depth from its lowest where readings answer on both sides of zero."""
    parts = [table.column(channel) for channel in channels if channel in table.columns]
    if not parts:
        return
    depth = entry.get("scale", 1.0) * table.column(name).astype(float) * _in_mm(table, name, entry)
    readings = np.column_stack(parts).astype(float)
    if low := below_zero([zero_side(depth[rows], readings[rows]) for rows in _each_press(depth)]):
        entry["offset"] = float(np.ceil(1000 * low) / 1000)
        notes.append(
            f"{name}: readings answer on both sides of its zero, so depth is counted from the lowest "
            f"(offset: {entry['offset']:g} mm); do other files go lower? Then take the lowest of all"
        )


def _each_press(depth: np.ndarray) -> list[slice]:
    """Return the rows from each highest point of a path to the next, one press each."""
    filled = np.nan_to_num(depth, nan=np.nanmin(depth))
    deep = filled > filled.min() + 0.5 * np.ptp(filled)
    edges = np.flatnonzero(np.diff(deep.astype(np.int8)))
    begins, ends = edges[~deep[edges]], edges[deep[edges]]
    successors = [int(begins[begins > end][0]) for end in ends if (begins > end).any()]
    middles = [(int(end) + begin) // 2 for end, begin in zip(ends, successors, strict=False)]
    return [slice(a, b) for a, b in pairwise([0, *middles, len(depth)])]


def _in_mm(table: SourceTable, name: str, entry: dict[str, Any]) -> float:
    """Return the factor of a column's unit, 1 where it has no length: the trial run of the mapping reports that."""
    try:
        return factor(unit_of(table, entry.get("column", name), name, entry.get("unit", "")) or "mm", "mm", "")
    except FormatError:
        return 1.0


def _cut(document: dict[str, Any], motion: PressingAxis, above: float | None, notes: list[str]) -> None:
    """Cut trials by pauses, or above a depth [mm]."""
    if motion.pause:
        document["trials"] = {"gap": motion.pause}
        notes.append(f"{motion.pauses} pauses of more than {motion.pause:g} s: each is taken for the end of a trial")
    elif motion.strokes > 1 and above is not None:
        document["trials"] = {"press_above": float(f"{above:.2g}")}
        notes.append(
            f"{motion.strokes} presses without a pause: each stretch deeper than {above:.2g} mm is taken for a trial"
        )


def _deviation(table: SourceTable, channels: list[str], axis: np.ndarray) -> np.ndarray | None:
    """Return how far the readings are from their first rows, each by its own range, shape (rows,); None if unknown.

    First rows end where the axis moves: cycles may begin at once.
    """
    parts = [table.column(name) for name in channels if name in table.columns]
    if not parts:
        return None
    values = np.column_stack(parts).astype(float)
    spread = np.nanmax(values, axis=0) - np.nanmin(values, axis=0)
    rows = np.flatnonzero(np.isfinite(axis))
    way = np.abs(axis - axis[rows[:1]].sum())
    departures = np.flatnonzero(way > CLEAR * np.ptp(axis[rows])) if len(rows) else rows
    first = np.nanmedian(values[: max(min([len(values) // 50, *departures[:1].tolist()]), 1)], axis=0)
    deviation = np.abs(values - first) / np.where(spread > 0, spread, 1.0)
    rows = np.isfinite(deviation)
    return np.where(rows, deviation, 0.0).sum(axis=1) / np.where(rows.any(axis=1), rows.sum(axis=1), np.nan)


def _specimen(alias: str, kind: str, entry: FoundKind, roles: dict[str, list[str]], notes: list[str]) -> dict[str, Any]:
    """Return where a file names the pressed specimen: in a column, or in its path; {} if nowhere."""
    for name in roles.get("specimen", []):
        if len({str(value) for value in entry.table.columns[name].tolist() if value is not None}) > 1:
            return {"file": alias, "column": name}
    parents = kind.partition(INSIDE)[0].split("#")[:-1]
    if place := next(({"part": f"part{k}"} for k, text in enumerate(parents) if SPECIMEN.search(text)), None):
        return place
    for number, words in entry.words.items():
        if 2 * sum(bool(MATERIAL.search(word)) for word in words) >= len(words):
            notes.append(f"the folders {listed(words)} are taken for specimens")
            return {"part": f"part{number}"}
        notes.append(
            f"are the folders {listed(words)} specimens? Then write press: {{specimen: {{part: part{number}}}}}"
        )
    return {}


def _place_in_path(kind: str) -> dict[str, str]:
    """Return which parts of a path are x and y, as in "x2.0_y-1.5"."""
    parents = kind.partition(INSIDE)[0].split("#")[:-1]
    matches = {k: PLACE.search(text) for k, text in enumerate(parents)}
    return {match[1].lower(): f"part{k}" for k, match in matches.items() if match}


def _unnamed(table: SourceTable, roles: dict[str, list[str]], notes: list[str]) -> None:
    again = [name for name in table.columns if name.endswith("'") and name.rstrip("'") not in roles.get("time", [])]
    if again and not any(name.endswith("'") for name in roles["channels"]):
        notes.append(
            f"{table.path.name}: each name comes again, as in trials side by side; only the first is read. Put the "
            "others below it with a column that numbers them, into sheets or into files"
        )
    if (len(table.columns) == 1 and table.inner(next(iter(table.columns)))) or all(map(str.isdigit, table.columns)):
        time = f", {roles['time'][0]} as the time by its steps" if roles.get("time") else ""
        notes.append(
            f"the columns of {table.path.name} have no names: which are position, force and channels? "
            f"{', '.join(_short(roles['channels']))} stand as channels{time}"
        )


def _file(kind: str, entry: FoundKind, roles: dict[str, list[str]], notes: list[str]) -> dict[str, Any]:
    table = entry.table
    outer, _, inside = kind.partition(INSIDE)
    path, parts = pattern(outer) if entry.count > 1 or "#" in inside else (entry.path, 0)
    result: dict[str, Any] = {"path": path, **entry.options}
    if entry.join:
        result |= _parts(entry, notes)
    elif "#" in inside:
        result["table"] = pattern(inside, parts)[0]
    if not roles.get("time"):
        rate, counter = rate_of(table, roles), counting_column(table, roles)
        notes.append(
            f"{Path(outer).name}: no column of times; {rate:g} rows a second is a guess, by which a press takes some "
            "2 s: give time: {rate: ...}" + f"; {counter} counts the rows" * bool(counter)
        )
        return result | {"time": {"rate": rate} | ({"column": counter} if counter else {})}
    clock: dict[str, Any] = {"column": roles["time"]}  # a date and a time of day
    if [table.column(name).dtype for name in roles["time"]] != [object, object]:
        unit = plain(table.units.get(roles["time"][0], ""))
        clock = {"column": roles["time"][0], **({"unit": unit} if unit in SHORT else {})}
    if "by_values" in roles:
        notes.append(f"{roles['time'][0]}: it rises evenly, and is taken for the time, in s where no unit is given")
    try:
        times(table, SourceClock(**clock), Path(outer).name)
    except FormatError as error:
        clock |= _american(table, roles["time"][0], notes)
        if "format" not in clock:
            notes.append(f"{error.given}: {error.remedy}")
    return result | {"time": clock}


def _parts(entry: FoundKind, notes: list[str]) -> dict[str, Any]:
    """Return the keys of a file whose parts are joined."""
    outer = [kind.partition(INSIDE)[0] for kind in entry.parts]
    sheets = [kind.partition(INSIDE)[2] for kind in entry.parts]
    same = len(set(outer)) == 1
    places = {"columns": "side by side", "rows": "below each other"}.get(
        entry.join, "below each other, the clock continued"
    )
    notes.append(f"{listed(sheets if same else outer)} are taken for parts of one trial, {places} (join: {entry.join})")
    result: dict[str, Any] = {"join": entry.join}
    if same:
        return result | {"table": sheets}
    return result | {"path": [pattern(kind)[0] for kind in outer]}


def _american(table: SourceTable, name: str, notes: list[str]) -> dict[str, str]:
    """Return the format of dates with AM and PM, where month and day could change places: the month comes first."""
    values = table.column(name)
    texts = [str(text).strip() for text in values.tolist() if text is not None] if values.dtype == object else []
    layouts = layouts_of(texts) if texts else []
    layout = next((layout for layout in layouts if layout.startswith("%m/") and "%p" in layout), None)
    if layout is None:
        return {}
    notes.append(f"{name}: {texts[0]!r} is read with the month first (format: {layout!r}); is it?")
    return {"format": layout}


def _without_error(table: SourceTable, columns: dict[str, list[str]], notes: list[str]) -> dict[str, Any]:
    """Return the measured depth as the set point minus the position error."""
    target, error = columns["depth"][0], columns["error"][0]
    notes.append(f"the position is taken as {target} - {error}: is the error the set point minus the position?")
    unit = {} if table.units.get(target) and table.units.get(target) == table.units.get(error) else {"unit": "mm"}
    return {"expression": f"`{target}` - `{error}`", **unit}


def _axis(table: SourceTable, name: str) -> dict[str, Any]:
    return {"column": name, **({} if name in table.units else {"unit": "mm"})}


def _length(table: SourceTable, entry: dict[str, Any], pressing: str) -> str:
    """Set the unit of lengths without one: m where no press would be so short in mm; return it."""
    # A stroke below 0.02 is no press in mm, but 2 mm written in m is.
    unit = "m" if float(np.nanmax(table.column(pressing)) - np.nanmin(table.column(pressing))) < SHORTEST else "mm"
    for axis_entry in entry.values():
        if "unit" in axis_entry:
            axis_entry["unit"] = unit
    return unit


def _short(names: list[str]) -> list[str]:
    """Return columns of one array that follow one another as one range: array[1-12]."""
    inner = [re.fullmatch(r"(.+)\[(\d+)\]", name) for name in names]
    numbers = [int(match[2]) for match in inner if match]
    if len(numbers) < max(len(names), 2) or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        return names
    return [f"{names[0].rpartition('[')[0]}[{numbers[0]}-{numbers[-1]}]"]
