"""Proposes a mapping for foreign files, and asks a person for values that the files lack."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import ColumnsEntry, FileEntry, ForeignSensor, Mapping, SourceClock, TrialRule
from tacdata.importing.mapping_document import document_of
from tacdata.importing.proposing.description import FoundKind
from tacdata.importing.proposing.drives import is_copy
from tacdata.importing.proposing.file_entry import proposed_file
from tacdata.importing.proposing.file_kinds import listed
from tacdata.importing.proposing.position import ProposedPosition, proposed_position
from tacdata.importing.proposing.question import Question, questions_of
from tacdata.importing.proposing.roles import later_blocks
from tacdata.importing.proposing.shapes import counting_column, varying
from tacdata.importing.proposing.source_kind import SourceKind, source_kinds, widest
from tacdata.importing.proposing.specimens import place_in_path, specimen_of
from tacdata.importing.proposing.stream_clocks import clock_by, own_clocks
from tacdata.importing.times import NEVER, times
from tacdata.importing.units import plain, split_unit

AXES = ("depth", "z", "x", "y")
IDLE = ("idle", "setting", "state", "counter", "orientation", "joint", "motion", "derived")
"""Roles of columns that are no channels of a sensor."""
NUMBERS = re.compile(r"\d+|(?<=[_ ])[a-z]$|(?<=^ch)[a-z]$")
"""What differs between the names of channels of one kind: numbers, or a letter at the end."""
NO_POSITION = ProposedPosition(
    questions=questions_of(["no column is named as a position or a depth: give position, or schedule"])
)


@dataclass(frozen=True)
class Proposal:
    """A mapping to start from."""

    mapping: Mapping
    open: tuple[Question, ...]
    """Values that a person has to give or to check."""
    kinds: tuple[SourceKind, ...]
    """Kinds of files, with the roles of their columns."""
    files: dict[str, FileEntry]
    """Entry of each kind, those that the mapping does not use among them."""

    @property
    def questions(self) -> tuple[str, ...]:
        """The open questions as sentences."""
        return tuple(question.text for question in self.open)

    @property
    def document(self) -> dict[str, Any]:
        """The mapping as its file holds it."""
        return self.mapping.document


def proposed_mapping(source: Path, found: dict[str, FoundKind]) -> Proposal:
    """Return a mapping for the kinds of files, as far as names and values allow, and its open questions."""
    kinds, notes = source_kinds(found)
    wide = widest(kinds)
    proposed = {kind.alias: proposed_file(kind) for kind in kinds}
    files = {alias: file.entry for alias, file in proposed.items()}
    clock_of = {alias: entry.clock or SourceClock() for alias, entry in files.items()}
    taxels, doubts = _taxels(wide, clock_of[wide.alias])
    axes = {kind.alias: [name for key in AXES for name in kind.roles.get(key, [])] for kind in kinds}
    # A height that never changes, as of an image, is a position only where nothing else is.
    ranked = sorted(kinds, key=lambda kind: (not varying(kind.table, axes[kind.alias]), -len(axes[kind.alias])))
    moving = next((kind for kind in ranked if {"depth", "z"} & set(kind.roles)), None)
    place = proposed_position(moving, clock_of[moving.alias], wide.channels) if moving else NO_POSITION
    if moving and moving is not wide and place.trials.gap and not _pauses(wide, taxels.clock, place.trials.gap):
        # A position that is sent only when it changes rests between two messages, and the readings go on.
        place = proposed_position(moving, clock_of[moving.alias], wide.channels, pauses=False)
    specimens = [specimen_of(kind) for kind in kinds]
    specimen = next((value for value, _ in specimens if value), None)
    numbering = [kind.roles["trial"][0] for kind in kinds if "trial" in kind.roles]
    path = {key: part for key, part in place_in_path(wide).items() if not place.entry or key not in place.entry.axes}
    position, clocks = place.entry, own_clocks(wide, place.entry) if place.entry and moving is wide else None
    shared: tuple[str, ...] = ()
    if position and clocks:
        shared = (f"{clocks[1]} is taken for the clock of the channels, and {clocks[0]} for the one of the position",)
        place = proposed_position(wide, clock_by(wide.table, clocks[0]), [])
        position = replace(place.entry or position, clock=clock_by(wide.table, clocks[0]))
        taxels = replace(taxels, clock=clock_by(wide.table, clocks[1]))
    measured = _measured(ranked, clock_of)
    used = {taxels.file, position and position.file, *(entry.file for entry in measured.values())}
    used |= {specimen.file} if specimen else set()
    mapping = Mapping(
        name=source.stem,
        source="say where the data come from",
        files={alias: entry for alias, entry in files.items() if alias in used},
        sensor=ForeignSensor(source.stem),
        taxels=taxels,
        position=position,
        contact=place.contact,
        known_from=place.known_from,
        trials=TrialRule(column=numbering[-1]) if numbering else place.trials,
        measured=measured,
        specimen=specimen or "",
        press=dict(path),
    )
    questions = (
        *questions_of(notes),
        *(question for file in proposed.values() for question in file.questions),
        *questions_of(doubts),
        *place.questions,
        *questions_of([f"{listed([*path])} of the press: taken from the files' names, in mm"] if path else []),
        *(question for _, further in specimens for question in further),
        *questions_of(
            [*_force_unit(kinds, measured.get("force")), *_unnamed(wide), *shared, *_unused(kinds, used, wide)]
        ),
    )
    return Proposal(Mapping.from_document(document_of(mapping), source.parent), questions, kinds, files)


def _taxels(kind: SourceKind, clock: SourceClock) -> tuple[ColumnsEntry, tuple[str, ...]]:
    """Return the sensor's channels, and a doubt if there is none."""
    table, roles, columns, doubts = kind.table, kind.roles, kind.channels, ()
    if not set(columns) <= set(table.columns):  # columns inside an array, and no names with brackets
        columns = short(columns)
    if not columns:  # the import says why columns of text are no numbers
        used = {name for names in roles.values() for name in names}
        texts = [name for name in table.columns if name not in used and table.column(name).dtype == object]
        columns = texts or [0]
        doubt = f"{listed(texts[:4])} hold text" if texts else "which are readings?"
        doubts = (f"no column is a channel: {doubt}",)
    units = {plain(table.units.get(name, "")) for name in kind.channels}
    entry = ColumnsEntry(file=kind.alias, clock=clock, columns=columns, unit=units.pop() if len(units) == 1 else "")
    if "value" in roles:
        return replace(entry, columns="", long={"channel": roles["number"][0], "value": roles["value"][0]}), doubts
    counter = counting_column(table, roles) if roles.get("time") else ""
    return replace(entry, counter=counter or None), doubts


def _pauses(kind: SourceKind, clock: SourceClock, gap: float) -> bool:
    """Return whether the clock of a kind of file has a step longer than a gap [s]."""
    try:
        time_ns, _ = times(kind.table, clock, "")
    except FormatError:  # reported where the clock was read
        return True
    return bool((np.diff(time_ns[time_ns != NEVER]) > gap * 1e9).any())


def _measured(kinds: list[SourceKind], clocks: dict[str, SourceClock]) -> dict[str, ColumnsEntry]:
    """Return gauge, force and temperature, each of the first kind that has it."""
    measured: dict[str, ColumnsEntry] = {}
    for kind in kinds:
        lengths = kind.roles.get("depth", [])
        # A second length is a gauge in addition to the drive; it separates compliance from the skin's deformation.
        gauges = [name for name in lengths[1:] if not is_copy(kind.table, lengths[0], name)][:1]
        columns = {"displacement": gauges}
        columns |= {key: kind.roles.get(key, []) for key in ("force", "torque", "temperature")}
        for key, names in columns.items():
            if names and key not in measured:
                unit = plain(kind.table.units.get(names[0], "")) or ("mm" if key == "displacement" else "")
                measured[key] = ColumnsEntry(file=kind.alias, clock=clocks[kind.alias], columns=names, unit=unit)
    return measured


def _force_unit(kinds: tuple[SourceKind, ...], force: ColumnsEntry | None) -> list[str]:
    """Return a question about a force without a unit."""
    names = [str(name) for name in force.columns] if force and isinstance(force.columns, list) else []
    units = [split_unit(name)[1] for name in names]
    if force is None or force.unit or any(unit and not unit.isdigit() for unit in units):
        return []
    table = next(kind.table for kind in kinds if kind.alias == force.file)
    values = np.column_stack([table.column(name).astype(float) for name in names])
    if not np.nansum(values % 1):
        return [
            f"{listed(names)}: whole numbers without a unit: how many are a newton? Give unit: 1/NUMBER N under force"
        ]
    return [f"{listed(names)}: no unit is given: give unit: N, mN, g or another one under force"]


def _unnamed(kind: SourceKind) -> list[str]:
    """Return questions about columns that have no names, or names that come again."""
    table, clocks, questions = kind.table, kind.roles.get("time", []), []
    again = [name for name in table.columns if name.endswith("'") and name.rstrip("'") not in clocks]
    again = again or list(later_blocks(table))
    if again and not any(name.endswith("'") for name in kind.channels):
        questions.append(
            f"{table.path.name}: each name comes again, as in trials side by side; only the first is read. Put the "
            "others below it with a column that numbers them, into sheets or into files"
        )
    of_kind: dict[tuple[str, str], list[str]] = {}
    for name in kind.channels:
        bare, unit = split_unit(name)
        of_kind.setdefault((NUMBERS.sub("", bare.lower()), table.units.get(name, unit)), []).append(name)
    if len(of_kind) > 1:
        kinds = "; ".join(listed(names[:4]) for names in list(of_kind.values())[:6])
        questions.append(
            f"channels of {len(of_kind)} kinds ({kinds}): keep under taxels the readings of one sensor alone"
        )
    if (len(table.columns) == 1 and table.inner(next(iter(table.columns)))) or all(map(str.isdigit, table.columns)):
        time = f", {clocks[0]} as the time by its steps" if clocks else ""
        questions.append(
            f"the columns of {table.path.name} have no names: which are position, force and channels? "
            f"{', '.join(short(kind.channels))} are taken for channels{time}"
        )
    return questions


def _unused(kinds: tuple[SourceKind, ...], used: set[Any], wide: SourceKind) -> list[str]:
    """Return questions about files without a role, and columns that measure nothing."""
    questions = [
        f"{kind.found.path} is not used: is {listed((kind.channels or list(kind.table.columns))[:4])} needed?"
        for kind in kinds
        if kind.alias not in used
    ]
    known = {name for names in wide.roles.values() for name in names}
    for name, values in wide.table.columns.items():
        texts = {str(value) for value in values.tolist()} if values.dtype == object and name not in known else set()
        if 2 * len(texts) > wide.table.rows and not re.search(r"\.[A-Za-z]\w{1,4}$", min(texts)):  # names of images
            questions.append(
                f"{name} holds text, as {min(texts)[:40]!r}, and is not used: if these are readings, save them as "
                "numbers, a column each"
            )
    if idle := [name for role in IDLE for name in wide.roles.get(role, [])]:
        more = f" and {len(idle) - 12} more" if len(idle) > 12 else ""
        questions.append(f"no channels but settings, states, counters or constants: {', '.join(idle[:12])}{more}")
    return questions


def short(names: list[str]) -> list[str]:
    """Return columns of one array that follow one another as one range: array[1-12]."""
    inner = [re.fullmatch(r"(.+)\[(\d+)\]", name) for name in names]
    numbers = [int(match[2]) for match in inner if match]
    if len(numbers) < max(len(names), 2) or numbers != list(range(numbers[0], numbers[0] + len(numbers))):
        return names
    return [f"{names[0].rpartition('[')[0]}[{numbers[0]}-{numbers[-1]}]"]
