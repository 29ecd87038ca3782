"""Notes of people on intervals of recordings, in a file of the same folder.

Like a flag, a note names the recording by its hash. Unlike a flag it takes nothing out of training.
"""

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from tacdata import documents, schemas
from tacdata.dataset.flags import LONGEST, who
from tacdata.dataset.format import metadata
from tacdata.errors import UsageError
from tacdata.paths import StrPath

IN_SESSION, IN_DATASET = Path("notes.json"), Path("meta/tacdata_notes.json")


@dataclass(frozen=True)
class Note:
    """A person's note on an interval of one recording."""

    recording: str
    """SHA-256 of the recording's file (hex)."""
    file: str
    """Name of the recording."""
    begin: float
    """Where the stretch begins, after the first reading [s]."""
    end: float
    """Where it ends [s]."""
    text: str
    """The note."""
    by: str
    """Who wrote it: user@computer."""
    at: str
    """Date and time, ISO 8601."""


def notes_path(folder: Path) -> Path:
    """Return where a session's or dataset's notes lie."""
    return folder / (IN_DATASET if (folder / "meta" / "info.json").is_file() else IN_SESSION)


def read_notes(folder: StrPath) -> list[Note]:
    """Return the notes of a session or dataset, by recording and time; none if nothing was ever noted.

    Raises:
        FormatError: If the file is damaged.
    """
    folder = Path(folder)
    path = notes_path(folder)
    if not path.is_file():
        return []
    return [Note(**entry) for entry in documents.read(path, "notes")["notes"]]


def add_note(folder: Path, recording: str, file: str, begin: float, end: float, text: str) -> Note:
    """Note something of a stretch of a recording.

    Args:
        folder: The session or dataset.
        recording: SHA-256 of the recording's file (hex).
        file: Its name.
        begin: Where the stretch begins, after the first reading [s].
        end: Where it ends [s].
        text: The note.

    Raises:
        UsageError: If the stretch is none, or there is no text, or a whole story.
        DeviceError: If the disk refuses it.
    """
    text = " ".join(text.split())
    if not 0 <= begin < end < float("inf"):
        raise UsageError(
            f"a note on {begin:g} to {end:g} s",
            "a stretch that begins at 0 s or later and ends after that",
            "give both times in seconds after the first reading",
        )
    if not text or len(text) > LONGEST:
        fault = "a note without a text" if not text else f"a note of {len(text)} letters"
        raise UsageError(fault, f"1 to {LONGEST} letters", "say in a sentence what is to be seen there")
    at = datetime.now(UTC).isoformat(timespec="seconds")
    note = Note(recording, file, float(begin), float(end), text, who(), at)
    _write(folder, [*read_notes(folder), note])
    return note


def remove_note(folder: Path, note: Note) -> None:
    """Take a note away; nothing happens where there is none like it."""
    notes = read_notes(folder)
    if note in notes:
        _write(folder, [entry for entry in notes if entry != note])


def carry_notes(source: Path, dataset: Path) -> int:
    """Give a dataset the notes of the session or dataset that it was made from; return how many are new to it.

    Raises:
        FormatError: If a file of notes is damaged.
        DeviceError: If the disk refuses it.
    """
    present = read_notes(dataset)
    recordings = {record.recording for record in metadata.read_records(dataset).values()}
    new = [note for note in read_notes(source) if note.recording in recordings and note not in present]
    if new:
        _write(dataset, [*present, *new])
    return len(new)


def _write(folder: Path, notes: list[Note]) -> None:
    ordered = sorted(notes, key=lambda note: (note.file, note.recording, note.begin, note.end))
    document = {"version": schemas.version("notes"), "notes": [asdict(note) for note in ordered]}
    documents.write(notes_path(folder), document, "notes")
