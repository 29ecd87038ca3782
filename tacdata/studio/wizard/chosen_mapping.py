"""Choices of a mapping, and the mapping of choices."""

from dataclasses import replace

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.importing.mapping import (
    Axis,
    ColumnsEntry,
    FileEntry,
    KnownValue,
    Mapping,
    PositionEntry,
    Quantity,
    Selector,
    SourceClock,
    TrialRule,
)
from tacdata.importing.mapping_document import document_of
from tacdata.importing.proposing.proposal import short
from tacdata.importing.source_table import SourceTable, select
from tacdata.studio.wizard.choices import AXES, FURTHER, Choices, ColumnRole

Tables = dict[str, SourceTable]
BY_HAND = "read off by a person"
"""Origin of a height of contact that was typed."""


def column_names(table: SourceTable) -> list[str]:
    """Return the columns of a table, those inside arrays each by itself."""
    inner = {name: [f"{name}[{k}]" for k in range(table.inner(name))] for name in table.columns}
    return [column for name, columns in inner.items() for column in columns or [name]]


def choices_of(mapping: Mapping, tables: Tables) -> Choices:
    """Return the choices that a mapping stands for; columns without a role are among them.

    Args:
        mapping: The mapping.
        tables: Every file, by its name under ``files``, with derived columns.
    """
    roles: dict[tuple[str, str], ColumnRole] = {}

    def assign(file: str, selector: Selector | None, role: str, unit: str = "", scale: float = 1.0) -> None:
        for name in _columns(tables[file], selector):
            roles[file, name] = ColumnRole(file, name, role, unit, scale)

    for alias, entry in mapping.files.items():
        if entry.clock and entry.clock.column is not None:
            assign(alias, entry.clock.column, "time" if entry.clock.rate is None else "counter", entry.clock.unit)
    taxels, position = mapping.taxels, mapping.position
    streams = [*mapping.measured.values(), taxels, *([position] if position else [])]
    for stream in streams:
        if stream.clock is not mapping.files[stream.file].clock and stream.clock.rate is None:
            assign(stream.file, stream.clock.column, "time", stream.clock.unit)
    assign(taxels.file, taxels.counter, "counter")
    for role in FURTHER:
        if role in mapping.measured:
            entry = mapping.measured[role]
            assign(entry.file, entry.columns, role, entry.unit, entry.scale)
    if not taxels.long:
        assign(taxels.file, taxels.columns, "channels", taxels.unit, taxels.scale)
    pressing = Axis()
    if position:
        for key, axis in position.columns.items():
            assign(position.file, axis.column, key, axis.unit, axis.scale)
            pressing = axis if key in ("z", "depth") else pressing
    rule, specimen = mapping.trials, mapping.specimen
    if rule.column is not None:
        for alias in mapping.files:
            assign(alias, rule.column, "trial")
    if isinstance(specimen, KnownValue) and specimen.column != "":
        assign(specimen.file or next(iter(mapping.files)), specimen.column, "specimen")
    z = mapping.contact.get("z")
    clocks = {alias: entry.clock or SourceClock() for alias, entry in mapping.files.items()}
    return Choices(
        tuple(
            roles.get((alias, name), ColumnRole(alias, name))
            for alias, table in tables.items()
            for name in column_names(table)
        ),
        {alias: clock.rate for alias, clock in clocks.items() if clock.rate is not None},
        {alias: clock.format for alias, clock in clocks.items() if clock.format},
        TrialRule() if rule.column is not None else rule,
        z if isinstance(z, float | int) else None,
        pressing.zero,
        pressing.offset,
        position is not None and position.trusted,
        specimen.part if isinstance(specimen, KnownValue) else "",
        (mapping.indenter or {}).get("radius"),
        mapping.name,
        mapping.source,
    )


def with_choices(base: Mapping, files: dict[str, FileEntry], tables: Tables, choices: Choices) -> Mapping:
    """Return a mapping with a person's choices. What they leave as it was stays as the base has it.

    Args:
        base: The mapping before.
        files: Every file that may be used.
        tables: Their columns.
        choices: The choices.

    Raises:
        FormatError: If a quantity has columns of two files, there is no channel, or a value is outside the schema.
    """
    earlier = choices_of(base, {alias: table for alias, table in tables.items() if alias in base.files})
    entries = {
        alias: replace(files[alias], clock=_clock(alias, base, files[alias], earlier, choices)) for alias in files
    }
    clocks = {alias: entry.clock or SourceClock() for alias, entry in entries.items()}
    stream_clocks = {
        id(stream): stream.clock
        for stream in (base.taxels, base.position, *base.measured.values())
        if stream and stream.clock is not base.files[stream.file].clock and _kept(earlier, choices, "time", stream.file)
    }

    def clock_of(stream: ColumnsEntry | PositionEntry | None, file: str) -> SourceClock:
        """Return a clock of its own that a stream keeps, else the file's."""
        return stream_clocks.get(id(stream), clocks[file]) if stream and stream.file == file else clocks[file]

    taxels = _taxels(base.taxels, earlier, choices)
    taxels = replace(taxels, clock=clock_of(base.taxels, taxels.file))
    position = _position(base.position, choices)
    if position:
        position = replace(position, clock=clock_of(base.position, position.file))
    measured = {key: entry for key, entry in base.measured.items() if key not in FURTHER}
    for key in FURTHER:
        if columns := choices.of_role(key):
            file, entry = _one_file(columns, key), base.measured.get(key)
            columns_entry = _chosen_columns(entry, key, earlier, choices, file)
            measured[key] = replace(columns_entry, clock=clock_of(entry, file))
    specimen: str | KnownValue = base.specimen if isinstance(base.specimen, str) else ""
    if columns := choices.of_role("specimen"):
        specimen = KnownValue(file=columns[0].file, column=columns[0].column)
    elif choices.specimen:
        same_specimen = isinstance(base.specimen, KnownValue) and base.specimen.part == choices.specimen
        specimen = base.specimen if same_specimen else KnownValue(choices.specimen)
    numbering = choices.of_role("trial")
    used = {taxels.file, *(entry.file for entry in measured.values()), *(each.file for each in numbering)}
    used |= {position.file} if position else set()
    used |= {specimen.file} if isinstance(specimen, KnownValue) and specimen.file else set()
    contact = {key: value for key, value in base.contact.items() if key != "z" or not isinstance(value, float | int)}
    touched = position is not None and not position.depth_given and choices.contact is not None
    contact |= {"z": choices.contact} if touched else {}
    known_from = BY_HAND if contact else Mapping.known_from
    if choices.contact == earlier.contact:
        known_from = base.known_from
    mapping = replace(
        base,
        name=choices.name or base.name,
        source=choices.source or base.source,
        files={alias: entry for alias, entry in entries.items() if alias in used},
        taxels=taxels,
        position=_at_zero(position, choices),
        measured=measured,
        trials=TrialRule(column=numbering[0].column) if numbering else choices.trials,
        contact=contact,
        known_from=known_from,
        specimen=specimen,
        indenter=base.indenter if choices.radius == earlier.radius else _sphere(choices.radius),
    )
    document = document_of(mapping)
    documents.check(document, "import_mapping", "the mapping")
    return Mapping.from_document(document, base.folder)


def _sphere(radius: float | None) -> dict[str, object] | None:
    return {"shape": "sphere", "radius": radius} if radius else None


def _columns(table: SourceTable, selector: Selector | None) -> list[str]:
    """Return the columns that a selector means, those inside arrays each by itself; [] if there are none."""
    if selector is None or selector == "":
        return []
    try:
        names = select(table, selector, "")
    except FormatError:
        return []
    return [inner for name in names for inner in ([f"{name}[{k}]" for k in range(table.inner(name))] or [name])]


def _kept(earlier: Choices, choices: Choices, role: str, file: str) -> bool:
    """Return whether the columns of a role in a file, with their units, are the same as before."""
    first, second = ([each for each in side.of_role(role) if each.file == file] for side in (earlier, choices))
    return first == second


def _one_file(columns: list[ColumnRole], words: str) -> str:
    files = list(dict.fromkeys(each.file for each in columns))
    if len(files) > 1:
        raise FormatError(
            f"{words} in {len(files)} files ({', '.join(files)})",
            "columns of one file",
            "give the others another role; boards with one clock are joined in the mapping (join: columns)",
        )
    return files[0]


def _clock(alias: str, base: Mapping, entry: FileEntry, earlier: Choices, choices: Choices) -> SourceClock:
    """Return the clock of a file: as before where nothing of it was changed."""
    names = [each for each in choices.of_role("time") if each.file == alias]
    clock = (base.files.get(alias) or entry).clock or SourceClock()
    layout, rate = choices.formats.get(alias), choices.rates.get(alias)
    if alias in base.files and _kept(earlier, choices, "time", alias):
        return replace(clock, format=layout, rate=rate if clock.rate is not None and rate else clock.rate)
    if not names:
        return SourceClock(rate=rate or clock.rate or 50.0)
    column = names[0].column if len(names) == 1 or names[0].unit else [each.column for each in names]
    return SourceClock(column=column, unit=names[0].unit, format=layout)


def _chosen_columns(
    entry: ColumnsEntry | None, role: str, earlier: Choices, choices: Choices, file: str
) -> ColumnsEntry:
    """Return the columns of a quantity: by the selector of before where they are the same."""
    columns = choices.of_role(role)
    names = [each.column for each in columns]
    first = columns[0]
    same = entry and entry.file == file and names == [each.column for each in earlier.of_role(role)]
    start = entry if entry and entry.file == file else ColumnsEntry(file=file, clock=SourceClock())
    return replace(
        start, columns=entry.columns if same and entry else short(names), unit=first.unit, scale=first.scale, long=None
    )


def _taxels(entry: ColumnsEntry, earlier: Choices, choices: Choices) -> ColumnsEntry:
    columns = choices.of_role("channels")
    if not columns and entry.long:
        return entry
    if not columns:
        raise FormatError("no column is a channel", "one channel or more", "give the readings the role channel")
    file = _one_file(columns, "channels")
    timed = any(each.file == file for each in choices.of_role("time"))
    counters = [each.column for each in choices.of_role("counter") if each.file == file and timed]
    return replace(
        _chosen_columns(entry, "channels", earlier, choices, file), counter=counters[0] if counters else None
    )


def _position(entry: PositionEntry | None, choices: Choices) -> PositionEntry | None:
    columns = choices.of_role(*AXES)
    pressing = choices.of_role("z", "depth")
    if not pressing:
        return entry if entry and not entry.columns else None
    if len({each.role for each in columns}) < len(columns) or len(pressing) > 1:
        names = ", ".join(each.column for each in columns)
        raise FormatError(
            f"two columns for one axis ({names})", "one depth or one height", "give the other another role"
        )
    file = _one_file(columns, "the position")
    base = entry if entry and entry.file == file else None
    axes: dict[str, Quantity] = {
        key: value for key, value in (base.axes if base else {}).items() if isinstance(value, float) and key in "xy"
    }
    for each in sorted(columns, key=lambda each: AXES.index(each.role)):
        same_column = [axis for axis in (base.columns if base else {}).values() if axis.column == each.column]
        axis = same_column[0] if same_column else Axis(each.column)
        axes[each.role] = replace(axis, unit=each.unit, scale=each.scale)
    start = base or PositionEntry(file=file, clock=SourceClock(), axes={})
    return replace(start, axes=axes)


def _at_zero(position: PositionEntry | None, choices: Choices) -> PositionEntry | None:
    if position is None:
        return None
    axes = {
        key: replace(axis, zero=choices.zero, offset=choices.offset)
        if isinstance(axis, Axis) and key in ("z", "depth")
        else axis
        for key, axis in position.axes.items()
    }
    return replace(position, axes=axes, trusted=choices.trusted)
