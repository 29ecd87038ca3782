"""A mapping as the document of its file: what differs from the defaults."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

from tacdata import schemas
from tacdata.importing.mapping import Axis, ColumnsEntry, FileEntry, Mapping, PositionEntry, Schedule, SourceClock


def document_of(mapping: Mapping) -> dict[str, Any]:
    """Return the document (`schemas/import_mapping.schema.json`) from which a mapping can be read again."""
    contact = {key: _plain(value) for key, value in mapping.contact.items()}
    known = {"known_from": mapping.known_from} if mapping.known_from != Mapping.known_from else {}
    specimen = {"specimen": _plain(mapping.specimen)} if mapping.specimen else {}
    trials = {"trials": _plain(mapping.trials)}
    sections = {
        "version": schemas.version("import_mapping"),
        "name": mapping.name,
        "source": mapping.source,
        "files": {name: _file(entry, _expressions(mapping, name)) for name, entry in mapping.files.items()},
        "sensor": _plain(mapping.sensor),
        "taxels": _stream(mapping.taxels, mapping.files),
        "position": mapping.position and _stream(mapping.position, mapping.files),
        "contact": contact | known,
        # A rule by the path belongs to the position.
        **(trials if mapping.trials.column is None else {}),
        "measured": {name: _stream(entry, mapping.files) for name, entry in mapping.measured.items()},
        "schedule": mapping.schedule and _schedule(mapping.schedule),
        **trials,
        "press": specimen | {key: _plain(value) for key, value in mapping.press.items()},
        "indenter": mapping.indenter,
    }
    return {key: value for key, value in sections.items() if value}


def _plain(value: Any) -> Any:
    """Return a value of a mapping as plain data: its fields that differ from their defaults."""
    if not is_dataclass(value) or isinstance(value, type):
        return [_plain(item) for item in value] if isinstance(value, tuple) else value
    given = {each.name: (getattr(value, each.name), each.default) for each in fields(value)}
    result = {name: _plain(item) for name, (item, default) in given.items() if item not in (default, {})}
    return {"expression": result.pop("expression")} | _without(result, "column") if "expression" in result else result


def _without(entry: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in entry.items() if name not in names}


def _file(entry: FileEntry, of_axes: set[str]) -> dict[str, Any]:
    options = _plain(replace(entry.options, missing=()))
    sections = {
        "path": list(entry.paths) if len(entry.paths) > 1 else entry.paths[0],
        **options,
        "table": entry.table,
        "join": entry.join,
        "derived": {name: text for name, text in entry.derived.items() if name not in of_axes},
        "missing": [*entry.options.missing, *entry.missing],
        "time": entry.clock and _plain(entry.clock),
    }
    return {key: value for key, value in sections.items() if value or key in options}


def _expressions(mapping: Mapping, file: str) -> set[str]:
    """Return the derived columns of a file that an axis names by its expression."""
    sections = [section for section in (mapping.position, mapping.schedule) if section and section.file == file]
    axes = [axis for section in sections for axis in section.axes.values()]
    return {str(axis.column) for axis in axes if isinstance(axis, Axis) and axis.expression}


def _stream(entry: ColumnsEntry | PositionEntry, files: dict[str, FileEntry]) -> dict[str, Any]:
    file, axes = files[entry.file], entry.axes if isinstance(entry, PositionEntry) else {}
    sections = {
        **{key: _plain(axis) for key, axis in axes.items()},
        "trusted": entry.trusted,
        "missing": list(entry.missing[len(file.missing) :]),
        # By identity: a clock that the stream was given stays its own where it equals the file's.
        "time": _plain(entry.clock) if entry.clock is not file.clock else None,
    }
    result = _without(_plain(entry), "axes", "clock", "missing", "trusted")
    return result | {key: value for key, value in sections.items() if value or key in axes}


def _schedule(schedule: Schedule) -> dict[str, Any]:
    result = _without(_plain(schedule), "axes", "clock")
    clock = {"time": _plain(schedule.clock)} if schedule.clock != SourceClock() else {}
    return result | {key: _plain(axis) for key, axis in schedule.axes.items()} | clock
