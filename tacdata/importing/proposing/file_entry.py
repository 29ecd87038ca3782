"""A kind of file as an entry of the mapping: its path, its parts, its clock."""

from dataclasses import dataclass, replace
from pathlib import Path

from tacdata.errors import FormatError
from tacdata.importing.mapping import FileEntry, SourceClock
from tacdata.importing.proposing.drives import rate_of
from tacdata.importing.proposing.file_kinds import INSIDE, listed, pattern
from tacdata.importing.proposing.question import Question
from tacdata.importing.proposing.shapes import counting_column
from tacdata.importing.proposing.source_kind import SourceKind
from tacdata.importing.proposing.stream_clocks import clock_by
from tacdata.importing.source_table import SourceTable
from tacdata.importing.times import layouts_of, seconds_and_parts, times

PLACES = {"columns": "side by side", "rows": "below each other"}
"""How parts of a trial are joined -> their places."""


@dataclass(frozen=True)
class ProposedFile:
    """An entry under ``files``."""

    entry: FileEntry
    questions: tuple[Question, ...]


def proposed_file(kind: SourceKind) -> ProposedFile:
    """Return how the files of a kind are found and read."""
    found, (outer, _, inside) = kind.found, kind.kind.partition(INSIDE)
    path, parts = pattern(outer) if found.count > 1 or "#" in inside else (found.path, 0)
    paths, table, questions = (path,), found.options.table, ()
    if len(found.parts) == 1:
        paths = (pattern(found.parts[0])[0],)
        text = (
            f"{found.parts[0]}: each file goes on where the one before it ends: they are parts of one log (join: rows)"
        )
        questions = (Question(text),)
    elif found.join:
        outers, sheets = zip(*(part.partition(INSIDE)[::2] for part in found.parts), strict=True)
        same = len(set(outers)) == 1
        place = PLACES.get(found.join, "below each other, the clock continued")
        names = listed(list(sheets if same else outers))
        questions = (Question(f"{names} are taken for parts of one trial, {place} (join: {found.join})"),)
        paths, table = (paths, list(sheets)) if same else (tuple(pattern(part)[0] for part in outers), table)
    elif "#" in inside:
        table = pattern(inside, parts)[0]
    if words := found.options.missing:
        questions += (Question(f"{listed(list(words))} in {found.path}: taken for no value (missing)"),)
    clock, doubts = _clock(kind, Path(outer).name)
    options = replace(found.options, table=None)
    return ProposedFile(FileEntry(paths, options, table, found.join, clock=clock), questions + doubts)


def _clock(kind: SourceKind, file: str) -> tuple[SourceClock, tuple[Question, ...]]:
    """Return the clock of a file, and doubts about it."""
    table, names = kind.table, kind.roles.get("time")
    if not names:
        rate, counter = rate_of(table, kind.roles), counting_column(table, kind.roles)
        source = "stated by the file" if table.rate else "a guess, by which a press takes some 2 s"
        text = (
            f"{file}: no column of times; {rate:g} rows a second is {source}: give time: {{rate: ...}}"
            + f"; {counter} counts the rows" * bool(counter)
        )
        return SourceClock(rate=rate, column=counter or None), (Question(text, "rate", file=kind.alias, value=rate),)
    is_dated = [table.column(name).dtype for name in names] == [object, object]  # a date and a time of day
    is_dated = is_dated or (len(names) > 1 and seconds_and_parts(table, names[:2], file) is not None)
    clock = SourceClock(column=names[:2]) if is_dated else clock_by(table, names[0])
    questions = ()
    if "by_values" in kind.roles:
        text = f"{names[0]}: it rises evenly, and is taken for the time, in s where no unit is given"
        questions = (Question(text),)
    try:
        times(table, clock, file)
    except FormatError as error:
        layout, text = _american(table, names[0])
        doubt = Question(f"{error.given}: {error.remedy}", "clock", (names[0],), kind.alias)
        if layout:
            doubt = Question(text, "date", file=kind.alias, word=layout)
        elif table.rate and table.column(names[0]).dtype != object:
            text = f"{names[0]}: its unit is not known; the file's {table.rate:g} rows a second are taken instead"
            clock, doubt = SourceClock(rate=table.rate), Question(text, "rate", file=kind.alias, value=table.rate)
        return replace(clock, format=layout), (*questions, doubt)
    return clock, questions


def _american(table: SourceTable, name: str) -> tuple[str | None, str]:
    """Return the format of dates with AM and PM, where month and day could change places: the month comes first."""
    values = table.column(name)
    texts = [str(text).strip() for text in values.tolist() if text is not None] if values.dtype == object else []
    layouts = layouts_of(texts) if texts else []
    layout = next((layout for layout in layouts if layout.startswith("%m/") and "%p" in layout), None)
    return layout, f"{name}: {texts[0]!r} is read with the month first (format: {layout!r}); is it?" if layout else ""
