"""Imports foreign files into a session folder, by a mapping."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.chain.at_rest import ZeroSide, below_zero, turned, zero_side
from tacdata.display import Displayed
from tacdata.errors import TacdataError, UsageError
from tacdata.importing import recording_file
from tacdata.importing.mapping import Mapping
from tacdata.importing.pressing.presses import Refusal, centre_of, presses_of
from tacdata.importing.pressing.rest_levels import RestLevel, rest_doubt, rest_level
from tacdata.importing.pressing.trials import split_tables
from tacdata.importing.recording_file import ImportedPress
from tacdata.importing.source_files import FileSet, file_sets, is_one, source_hash
from tacdata.importing.source_table import SourceTable
from tacdata.recording import session
from tacdata.recording.files import file_names
from tacdata.recording.session import FILE


@dataclass(frozen=True, repr=False)
class Imported(Displayed):
    """Result of an import."""

    folder: Path
    """The session."""
    recordings: int
    notes: tuple[str, ...]
    """Remarks for a person, as sentences, each once."""
    refused: tuple[str, ...]
    """Trials that could not be imported, and why."""

    def __fspath__(self) -> str:
        """Return the session's folder."""
        return str(self.folder)

    def description(self) -> Iterator[str]:
        """Yield recordings, and the first of the trials that were refused and of the notes."""
        yield f"Import: {self.recordings} recordings in {self.folder}"
        if self.refused:
            yield f"{len(self.refused)} trials refused; the first: {self.refused[0].splitlines()[0]}"
        if self.notes:
            yield f"{len(self.notes)} notes; the first: {self.notes[0].splitlines()[0]}"


def import_session(
    source: Path, mapping: Path, target: Path, progress: Callable[[str], None] = lambda text: None
) -> Imported:
    """Import everything that a mapping finds in a source.

    Args:
        source: A folder or a file.
        mapping: The mapping's file (`schemas/import_mapping.schema.json`).
        target: Session folder to create.
        progress: Called with a line for every recording.

    Raises:
        UsageError: If ``target`` exists, or a file is missing.
        FormatError: If nothing could be imported, with the first reason.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.importing.imported_session import import_session
        >>> made = import_session(Path("source"), Path("examples/import_foreign.yaml"), Path("imported"))
        >>> made.recordings
        3
        >>> made.refused
        ()
    """
    contents = Mapping.from_document(documents.read(mapping, "import_mapping"), mapping.parent)
    if target.exists():
        raise UsageError(f"{target} exists", "a new session folder", "choose another --out")
    sets = file_sets(source, contents.files)
    target.parent.mkdir(parents=True, exist_ok=True)
    # On the same drive, so that the rename at the end is atomic.
    work = Path(mkdtemp(dir=target.parent, prefix=f".{target.name}."))
    try:
        run = _Import(contents, source, work, progress)
        for files in sets:
            run.add(files)
        if not run.presses:
            raise run.failures[0][1]
        run.finish()
        with suppress(OSError):  # a drive without permissions
            work.chmod(0o755)
        work.rename(target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    refused = tuple(f"{label}: {error.given}" for label, error in run.failures)
    return Imported(target, len(run.presses), tuple(dict.fromkeys(run.notes)), refused)


class _Import:
    """An import in progress."""

    def __init__(self, mapping: Mapping, source: Path, work: Path, progress: Callable[[str], None]) -> None:
        self.mapping, self.source, self.work, self.progress = mapping, source, work, progress
        self.hash = mapping.content_hash
        self.presses: list[ImportedPress] = []
        self.failures: list[tuple[str, TacdataError]] = []
        self.notes: list[str] = []
        self.seen: dict[tuple[Any, ...], str] = {}
        self.recorded: dict[tuple[int, ...], str] = {}
        self.centre: tuple[float, float] | None = None
        self.sides: list[ZeroSide] = []
        self.rests: list[RestLevel] = []

    def add(self, files: FileSet) -> None:
        """Import one set of files."""
        if files.fault:
            self.failures.append((files.label or self.source.name, files.fault))
            return
        if copied := self._copied(files):
            self.notes.append(copied)
            return
        try:
            tables = files.tables()
            trials = list(split_tables(tables, self.mapping))
        except TacdataError as error:
            self.failures.append((files.label or self.source.name, error))
            return
        # One trial that cannot be read must not cost the others.
        for label, rows in trials:
            named = " ".join(part for part in (files.label, label) if part)
            try:
                for imported in self._presses(files, named, tables, rows):
                    if isinstance(imported, Refusal):
                        self.failures.append((imported.trial or self.source.name, imported.error))
                    else:
                        self._write(imported)
            except TacdataError as error:
                self.failures.append((named or self.source.name, error))

    def _copied(self, files: FileSet) -> str:
        """Return a note that a set of files is a copy, byte by byte, of one before it; empty if it is not.

        A copy is no second measurement: counted as one, it would make every error look smaller.
        """
        # The table belongs to it: two sheets of one workbook have one hash.
        contents = tuple((source_hash(file.paths[0]), str(file.entry.table)) for file in files.files.values())
        name = ", ".join(file.paths[0].name for file in files.files.values())
        first = self.seen.setdefault(contents, name)
        return f"{name} is the same, byte by byte, as {first} and is left out" if first != name else ""

    def _recorded_before(self, imported: ImportedPress) -> str:
        """Return a note that a recording is a copy, value by value, of one before it; empty if it is not.

        A table that is pasted twice, or saved in two formats, is no second measurement either.
        """
        taxels, position = imported.taxels, imported.position
        if (taxels.values[1:] != taxels.values[:-1]).any(axis=1).mean() <= 0.5:
            return ""  # without noise two presses may read the same
        arrays = (taxels.time_ns, taxels.values, position.time_ns, position.values)
        press = imported.press
        stated = hash((press.x, press.y, press.depth, press.speed, press.hold))
        contents = (stated, *(hash(np.ascontiguousarray(each).tobytes()) for each in arrays))
        label = imported.record["trial"] or self.mapping.name
        first = self.recorded.setdefault(contents, label)
        return f"{label} is the same, value by value, as {first} and is left out" if first != label else ""

    def _presses(
        self, files: FileSet, label: str, full_tables: dict[str, SourceTable], rows: dict[str, SourceTable]
    ) -> Iterator[ImportedPress | Refusal]:
        below = self.source.parent if is_one(self.source) else self.source
        record = {
            "version": schemas.version("import_record"),
            "name": self.mapping.name,
            "source": self.mapping.source,
            "trial": label,
            "files": [
                {
                    "path": path.relative_to(below).as_posix(),
                    "sha256": source_hash(path),
                    "rows": full_tables[name].rows,
                }
                for name, file in files.files.items()
                for path in file.paths
            ],
            "mapping": self.mapping.document,
            "mapping_hash": self.hash,
            "code_version": provenance.code_version(),
        }
        # From the first files: all recordings of a session share one origin.
        if self.centre is None:
            self.centre = centre_of(self.mapping.position, full_tables)
        yield from presses_of(self.mapping, rows, files.parts, record, self.centre)

    def _write(self, imported: ImportedPress) -> None:
        number = len(self.presses)
        if copied := self._recorded_before(imported):
            self.notes.append(copied)
            return
        imported = replace(imported, record=_in_unicode(imported.record))
        press = replace(imported.press, index=number)
        plan = plan_of(self.mapping.name, [press])
        imported = replace(imported, press=press, plan=plan)
        documents.check(imported.record, "import_record", "import record")
        path = file_names.episode(self.work, number)
        recording_file.write(path, imported)
        trial = imported.record["trial"]
        self.notes += imported.record["notes"]
        depth = imported.registration["origin"][2] - imported.position.values[:, 2]
        at = np.interp(imported.taxels.time_ns, imported.position.time_ns, depth)
        self.sides.append(zero_side(at, imported.taxels.values))
        if level := rest_level(trial, at, imported.taxels.values):
            self.rests.append(level)
        # At the end only the press is needed, and the rows of all recordings would fill the memory.
        self.presses.append(replace(imported, taxels=None, position=None, measured=()))
        rows = len(imported.taxels.time_ns)
        self.progress(f"  {path.name}  {trial or self.mapping.name}: {rows} rows, {press.depth:.2f} mm deep")

    def finish(self) -> None:
        """Write the session's document."""
        if below := below_zero(self.sides):
            lowest = np.ceil(1000 * below) / 1000
            self.notes.append(
                f"readings answer as much below zero, down to {below:.4g} mm, as above: does it touch there, too? "
                f"Then count depth from the lowest (offset: {lowest:g} under depth, or contact); else it is no contact"
            )
        if numbers := turned(self.sides):
            self.notes.append(
                f"readings answer below zero alone in {len(numbers)} of {len(self.sides)} recordings, the first is "
                f"{numbers[0]}: is the depth's sign another there? Then give scale: -1 for their files"
            )
        if doubt := rest_doubt(self.rests):
            self.notes.append(doubt)
        first = self.presses[0]
        plan = plan_of(self.mapping.name, [imported.press for imported in self.presses])
        document = {
            "version": "1.0",
            "code_version": provenance.code_version(),
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "rig": first.rig,
            "plan": plan,
            "plan_hash": provenance.content_hash(plan),
            "sensor": first.sensor.document,
            "sensor_hash": first.sensor.content_hash,
            "episodes": [],
        }
        documents.write(self.work / FILE, document, "session")
        session.refresh(session.read_session(self.work))


def _in_unicode(value: Any) -> Any:
    """Return a document without the marks of bytes that are no text, as names of files may have them."""
    if isinstance(value, dict):
        return {key: _in_unicode(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_in_unicode(part) for part in value]
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value


def plan_of(name: str, presses: list[Any]) -> dict[str, Any]:
    """Return a document of a plan that describes the imported presses; tacdata never executed it."""
    slowest = min(press.speed for press in presses)
    # A recording that touches nothing has a negative depth: the plan flies lower than that.
    clearance = 1.0 + max(0.0, *(-press.depth for press in presses))
    speeds = dict.fromkeys(("travel_speed", "approach_speed", "press_speed"), slowest)
    motion = {"clearance": clearance, **speeds, "hold": 0.0, "rest": 0.0}
    entries = [
        {
            "indenter": p.indenter_name,
            "x": p.x,
            "y": p.y,
            **p.angles,
            "depth": p.depth,
            "speed": p.speed,
            "hold": p.hold,
        }
        for p in presses
    ]
    indenters = {press.indenter_name: press.indenter.document for press in presses}
    return {
        "version": schemas.version("plan"),
        "name": name,
        "purpose": "described by imported data, not driven",
        "indenters": indenters,
        "motion": motion,
        "presses": entries,
    }
