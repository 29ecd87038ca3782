"""Lists what is in foreign files and proposes a mapping, by the columns' names, for a person to correct."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

import schemas
from tacdata.errors import TacdataError, UsageError
from tacdata.importing.formats.source_format import SourceTable, read_table, tables_in
from tacdata.importing.source_files import files_below, is_one
from tacdata.importing.units import plain, quantity_of, split_unit

SHORT = ("s", "ms", "us", "ns", "min", "h", "d")
"""Units of time that a mapping may name; others stand in the header and are read from there."""
GUESSES = {
    "time": r"(time|t|timestamp|stamp|zeit|clock|datetime|date)",
    "depth": r"(depth|indentation|displacement|disp|travel|stroke|extension|pos(ition)?|weg|eindringtiefe|d)",
    "x": r"(x|pos_?x|x_?pos(ition)?|stage_?x)",
    "y": r"(y|pos_?y|y_?pos(ition)?|stage_?y)",
    "z": r"(z|pos_?z|z_?pos(ition)?|stage_?z|height)",
    "force": r"(f|fz|fn|force(_?z)?|load|weight|kraft|normal_?force|force_?[xyz]|f[xy])",
    "temperature": r"(temp(erature)?|t_?amb)",
    "trial": r"(trial|run|cycle|episode|press|repeat|rep|test|versuch|element)(_?(id|no|nr|number))?",
    "specimen": (
        r"(specimen|material|coupon|silicone|elastomer|werkstoff)(_?(id|no|nr|number|name))?"
        r"|sample_?(id|no|nr|number|name)"
    ),
    "counter": r"(counter|frame|seq(uence)?|sample|index|n)",
}
"""Meaning of a column by its name without the unit."""
GAUGE = r"lvdt|laser|gauge|extensometer|encoder|true|actual|measured"
"""Words that mark a length as measured beside the commanded one."""
NUMBER = re.compile(r"\d+(?:[.,]\d+)?")
"""A number in a file's name: "run_0.2" and "run_1" are two runs of one kind."""
SPECIMEN = re.compile(r"(?:specimen|spec|sample|material|coupon)[-_ ]?$", re.IGNORECASE)
"""What stands in a path before the number of a specimen."""
INSIDE = "::"
"""Between a file's path and the table inside it."""
SHOWN = 30
"""Columns that are listed per file."""


def described(source: Path) -> tuple[dict[str, SourceTable], str]:
    """Return one table of each kind of file in a source, and a description of them.

    Raises:
        UsageError: If nothing there can be read.
    """
    if not source.exists():
        raise UsageError(f"no file or folder {source}", "measured data", "check the path")
    paths = [source] if is_one(source) else files_below(source)
    tables: dict[str, SourceTable] = {}
    count: dict[str, int] = {}
    refused = []
    below = [path.relative_to(source) if path != source else Path(path.name) for path in paths]
    for path, kind in zip(paths, _kinds(below), strict=True):
        count[kind] = count.get(kind, 0) + 1
        if count[kind] > 1:
            continue
        try:
            for name in tables_in(path):
                tables[f"{kind}{INSIDE}{name}" if name else kind] = read_table(path, {"table": name} if name else {})
        except ModuleNotFoundError:
            raise
        except Exception as error:  # a README beside the data is no error
            if is_one(source) and isinstance(error, TacdataError):
                raise
            words = error.given if isinstance(error, TacdataError) else f"{kind}: {type(error).__name__}"
            refused.append(words.removeprefix(f"{source}/"))
    if not tables:
        raise UsageError(
            f"no file in {source} can be read as columns ({', '.join(refused) or 'it is empty'})",
            "CSV, Excel, NPZ, Parquet or MATLAB files, or bags of ROS 2", "check the path, or convert the files",
        )  # fmt: skip
    lines = []
    for key, table in tables.items():
        kind, _, inside = key.partition(INSIDE)
        files = f"{count[kind]} file{'s' * (count[kind] > 1)}"
        lines.append(f"{kind} ({files}){f', {inside}' if inside else ''}: {table.rows} rows")
        lines += [_line(table, name) for name in list(table.columns)[:SHOWN]]
        if len(table.columns) > SHOWN:
            lines.append(f"    and {len(table.columns) - SHOWN} more columns")
        lines += [f"    {note}" for note in table.notes]
    lines += [f"not read: {text}" for text in refused]
    return tables, "\n".join(lines)


def _kinds(paths: list[Path]) -> list[str]:
    """Return the paths with # in place of numbers; a minus is part of the number where others have none there."""
    kinds = [NUMBER.sub("#", path.with_suffix("").as_posix()) + path.suffix for path in paths]  # the 3 of .db3 stays
    positive = set(kinds)
    return [signed if (signed := kind.replace("-#", "#")) in positive else kind for kind in kinds]


def _line(table: SourceTable, name: str) -> str:
    values = table.columns[name]
    unit = f" [{table.units[name]}]" if table.units.get(name) and f"[{table.units[name]}]" not in name else ""
    if values.dtype == object:
        known = sorted({str(value) for value in values.tolist() if value is not None})
        return f"    {name}{unit}: text, {len(known)} different, for example {', '.join(known[:3])}"
    numbers = values.astype(float)
    missing = np.isnan(numbers).mean()
    shape = f" x {values.shape[1]}" if values.ndim > 1 else ""
    if missing == 1:
        return f"    {name}{unit}{shape}: no value"
    common, times = np.unique(numbers[np.isfinite(numbers)], return_counts=True)
    often = times.max() / numbers.size
    remark = f", {100 * missing:.0f} % missing" * bool(missing)
    if often > 0.2 and len(common) > 10 and common[times.argmax()] in (-1, 0, -999, -9999, 9999, 65535):
        remark += f", {100 * often:.0f} % are {common[times.argmax()]:g}: missing?"
    return f"    {name}{unit}{shape}: {np.nanmin(numbers):.9g} to {np.nanmax(numbers):.9g}{remark}"


def proposed_mapping(source: Path, tables: dict[str, SourceTable]) -> dict[str, Any]:
    """Return a mapping's document for the tables, as far as their names allow."""
    aliases: dict[str, str] = {}
    for kind in tables:
        path, _, inside = kind.partition(INSIDE)
        alias = re.sub(r"\W+", "_", (inside or Path(path).stem).lower()).strip("_") or "data"
        while alias in aliases:
            alias += "_"
        aliases[alias] = kind
    roles = {alias: _roles(tables[kind]) for alias, kind in aliases.items()}
    if not any(found["channels"] for found in roles.values()):
        # Nothing else was read: the load cell is the sensor.
        for found in roles.values():
            found["channels"] = found.pop("force", [])
    wide = max(aliases, key=lambda alias: len(roles[alias]["channels"]))
    document: dict[str, Any] = {
        "version": schemas.version("import_mapping"), "name": source.stem, "source": "say where the data come from",
        "files": {alias: _file(kind, tables[kind], roles[alias]) for alias, kind in aliases.items()},
        "sensor": {"name": source.stem},
        "taxels": {"file": wide, "columns": roles[wide]["channels"] or [0]},
    }  # fmt: skip
    units = {plain(tables[aliases[wide]].units.get(name, "")) for name in roles[wide]["channels"]}
    if len(units) == 1 and units != {""}:
        document["taxels"]["unit"] = units.pop()
    for alias, found in roles.items():
        if "position" not in document and ("depth" in found or "z" in found):
            chosen = ("x", "y", "depth") if "depth" in found else ("x", "y", "z")
            document["position"] = {"file": alias} | {
                key: _axis(tables[aliases[alias]], found[key][0]) for key in chosen if key in found
            }
        lengths = found.get("depth", [])
        if len(lengths) > 1 and "displacement" not in document.get("measured", {}):
            # A second length is a gauge beside the drive; it separates compliance from the skin's deformation.
            told = {"file": alias, "columns": lengths[1:2], "unit": _unit(tables[aliases[alias]], lengths[1])}
            document.setdefault("measured", {})["displacement"] = told
        for key in ("force", "temperature"):
            if key in found and key not in document.get("measured", {}):
                unit = tables[aliases[alias]].units.get(found[key][0])
                entry = {"file": alias, "columns": found[key], **({"unit": plain(unit)} if unit else {})}
                document.setdefault("measured", {})[key] = entry
        if "trial" in found:
            document["trials"] = {"column": found["trial"][0]}
        if specimen := _specimen(alias, aliases[alias], tables[aliases[alias]], found):
            document.setdefault("press", {"specimen": specimen})
    return document


def _specimen(alias: str, kind: str, table: SourceTable, roles: dict[str, list[str]]) -> dict[str, Any]:
    """Return where a file says which specimen was pressed: in a column, or in its path; {} if nowhere."""
    for name in roles.get("specimen", []):
        if len({str(value) for value in table.columns[name].tolist() if value is not None}) > 1:
            return {"file": alias, "column": name}
    before = kind.partition(INSIDE)[0].split("#")[:-1]
    return next(({"part": f"part{k}"} for k, text in enumerate(before) if SPECIMEN.search(text)), {})


def _unit(table: SourceTable, name: str) -> str:
    return plain(table.units.get(name, "")) or "mm"


def _roles(table: SourceTable) -> dict[str, list[str]]:
    roles: dict[str, list[str]] = {"channels": []}
    for name, values in table.columns.items():
        bare = split_unit(name.rsplit(".", 1)[-1])[0].lower()
        role = next((role for role, pattern in GUESSES.items() if re.fullmatch(pattern, bare)), None)
        unit = quantity_of(table.units.get(name, ""))
        role = {"N": "force", "s": "time"}.get(unit or "", role)
        role = "depth" if role is None and unit == "mm" else role
        if role is None and values.dtype != object:
            roles["channels"].append(name)
        elif role:
            roles.setdefault(role, []).append(name)
    roles["depth"] = sorted(roles.get("depth", []), key=lambda name: bool(re.search(GAUGE, name.lower())))
    if not roles["depth"]:
        del roles["depth"]
        if "x" in roles and not {"y", "z"} & set(roles):
            # One axis only: it is the one that presses.
            roles["depth"] = roles.pop("x")
    if "time" not in roles and table.columns and not any(re.search(r"[A-Za-z]", name) for name in table.columns):
        # Without a header, the first increasing column is most likely the time.
        for name in list(roles["channels"]):
            if (np.diff(table.columns[name]) >= 0).all():
                roles["time"] = [name]
                roles["channels"].remove(name)
                break
    return roles


def _file(kind: str, table: SourceTable, roles: dict[str, list[str]]) -> dict[str, Any]:
    path, _, inside = kind.partition(INSIDE)
    for k in range(path.count("#")):
        path = path.replace("#", f"{{part{k}}}", 1)
    found: dict[str, Any] = {"path": path, **({"table": inside} if inside else {})}
    if "time" not in roles:
        return found | {"time": {"rate": 100.0}}
    if [table.columns[name].dtype for name in roles["time"]] == [object, object]:
        # A date and a time of day.
        return found | {"time": {"column": roles["time"]}}
    unit = plain(table.units.get(roles["time"][0], ""))
    return found | {"time": {"column": roles["time"][0], **({"unit": unit} if unit in SHORT else {})}}


def _axis(table: SourceTable, name: str) -> dict[str, Any]:
    return {"column": name, **({} if name in table.units else {"unit": "mm"})}
