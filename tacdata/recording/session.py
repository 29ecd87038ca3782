"""A folder of recordings made by one plan on one rig."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.display import Displayed
from tacdata.errors import DeviceError, FormatError, TacdataError, UsageError
from tacdata.labels import file_names as label_files
from tacdata.paths import StrPath
from tacdata.plans import Plan
from tacdata.recording.episode import Episode
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_episode, read_recording
from tacdata.sensor import Sensor

FILE = "session.json"
_OTHERS = {
    "demonstrations.json": "it holds demonstrations by hand: process them with tacdata track",
    "meta/tacdata.json": "it is a dataset: name the recordings that it was packed from; simulated presses have none",
    "simulation.json": "it holds simulated presses, nobody recorded them: name recordings",
}
"""File of another kind of folder -> remedy."""


@dataclass(frozen=True, repr=False)
class Session(Displayed):
    """A session folder: its recordings and its document. Iterating reads its episodes one by one.

    Example:
        >>> import tacdata as td
        >>> session = td.read_session("session")
        >>> len(session), [episode.press.depth for episode in session]
        (2, [0.8, 0.8])
        >>> session[1].number
        1
    """

    folder: Path
    """The folder."""
    episodes: tuple[Path, ...]
    """Finished recordings, in the order of the plan."""
    unfinished: tuple[Path, ...]
    """Recordings that were interrupted; readable, but never labelled."""
    plan: Plan
    sensor: Sensor
    document: dict[str, Any]
    """`session.json` (`schemas/session.schema.json`)."""

    def __len__(self) -> int:
        """Number of finished recordings."""
        return len(self.episodes)

    def __getitem__(self, number: int) -> Episode:
        """Read the episode of this number.

        Raises:
            UsageError: If no press of that number is recorded.
        """
        recorded = file_names.finished(self.folder)
        if number not in recorded:
            allowed = ", ".join(map(str, recorded)) if len(recorded) <= 20 else f"one of {len(recorded)} numbers"
            raise UsageError(f"{self.folder} has no episode {number}", allowed or "none yet", "choose one of them")
        return read_episode(recorded[number])

    def __iter__(self) -> Iterator[Episode]:
        """Read the finished recordings one by one, in the order of the plan."""
        return map(read_episode, self.episodes)

    def __fspath__(self) -> str:
        """Return the folder: functions that take a path take the object, too."""
        return str(self.folder)

    def description(self) -> Iterator[str]:
        """Yield the lines of its description: recordings, sensor, plan."""
        yield f"Session {self.folder}: {len(self)} of {len(self.plan.presses)} presses of plan {self.plan.name!r}"
        yield f"sensor {self.sensor.name}, {self.sensor.taxels.columns} × {self.sensor.taxels.rows} taxels"
        labels = [path for path in self.episodes if label_files.label(self.labels, path).is_file()]
        yield f"{len(labels)} labelled"
        if self.unfinished:
            yield f"{len(self.unfinished)} recordings interrupted"

    @property
    def labels(self) -> Path:
        """The folder of its labels."""
        return label_files.folder(self.folder)

    @property
    def done(self) -> frozenset[int]:
        """Numbers of the presses that are recorded."""
        return frozenset(file_names.finished(self.folder))

    @property
    def remaining(self) -> tuple[int, ...]:
        """Numbers of the presses that are not recorded yet, in order."""
        done = self.done
        return tuple(press.index for press in self.plan.presses if press.index not in done)


def read_session(folder: StrPath) -> Session:
    """Read a session folder.

    Raises:
        UsageError: If the folder is no session.
        FormatError: If its document is damaged or names recordings that are missing.

    Example:
        >>> import tacdata as td
        >>> session = td.read_session("session")
        >>> [path.name for path in session.episodes]
        ['episode-000000.mcap', 'episode-000001.mcap']
        >>> session.remaining  # presses of the plan that are not recorded yet
        ()
    """
    folder = Path(folder)
    if not (folder / FILE).is_file():
        remedy = next(
            (words for file, words in _OTHERS.items() if (folder / file).is_file()),
            "check the path; measured files of another rig come in by `tacdata import`",
        )
        allowed = "a folder written by tacdata record or tacdata import"
        raise UsageError(f"{folder} is no session: no {FILE} in it", allowed, remedy)
    document = documents.read(folder / FILE, "session")
    origin = str(folder / FILE)
    files = file_names.finished(folder)
    missing = [entry["file"] for entry in document["episodes"] if not (folder / entry["file"]).is_file()]
    if missing:
        more = f" and {len(missing) - 3} others" if len(missing) > 3 else ""
        raise FormatError(
            f"{origin} names {', '.join(missing[:3])}{more}, not in {folder}",
            "every finished recording beside its session.json",
            "put the files back, or remove their entries",
        )
    return Session(
        folder,
        tuple(files.values()),
        tuple(file_names.unfinished(folder)),
        Plan.from_document(document["plan"], f"{origin}: plan"),
        Sensor.from_document(document["sensor"], f"{origin}: sensor"),
        document,
    )


def create_session(folder: Path, plan: Plan, sensor: Sensor, rig: dict[str, Any]) -> Session:
    """Create the folder with its document.

    Raises:
        UsageError: If the folder exists.
        DeviceError: If the disk refuses it.
    """
    if folder.exists():
        raise UsageError(
            f"{folder} exists", "a new session folder", "choose another --out, or continue it with --resume"
        )
    if plan.document is None:
        raise UsageError(
            f"plan {plan.name} has no document", "a plan read from a file", "write the plan to a file first"
        )
    document = {
        "version": schemas.version("session"),
        "code_version": provenance.code_version(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "rig": rig,
        "plan": plan.document,
        "plan_hash": provenance.content_hash(plan.document),
        "sensor": sensor.document,
        "sensor_hash": sensor.content_hash,
        "episodes": [],
    }
    try:
        documents.write(folder / FILE, document, "session")
    except DeviceError:
        with suppress(OSError):
            folder.rmdir()  # so that the same command can begin again
        raise
    return read_session(folder)


def resume_session(folder: Path, plan: Plan, sensor: Sensor, rig: dict[str, Any]) -> Session:
    """Continue a session; a file that a crash left half written is renamed and kept.

    A recording that a crash left whole, before it had got its name, gets it now.

    Raises:
        UsageError: If it was made with another plan or sensor, or the skin is at another place on the rig.
    """
    session = read_session(folder)
    old = session.document
    for what, original, present in (
        ("plan", old["plan_hash"], provenance.content_hash(plan.document)),
        ("sensor", old["sensor_hash"], sensor.content_hash),
        ("registration", old["rig"].get("registration"), rig.get("registration")),
        ("set of tool offsets", old["rig"].get("tools"), rig.get("tools")),
    ):
        if original != present:
            raise UsageError(
                f"{folder} was begun with another {what}",
                f"the same {what}; one session holds one of each",
                "use the files it was begun with, or start a new session",
            )
    # A crash between the last byte and the renaming leaves a whole recording under its partial name.
    for path in folder.glob(f"*{file_names.PARTIAL}"):
        final = path.with_name(path.name.removesuffix(file_names.PARTIAL) + ".mcap")
        path.rename(final if _is_whole(path, final) else file_names.next_interrupted(final))
    return refresh(read_session(folder))


def _is_whole(path: Path, final: Path) -> bool:
    if not file_names.EPISODE.fullmatch(final.name) or final.exists():
        return False
    try:
        return read_recording(path).episode.complete
    except TacdataError:
        return False


def linked_session(session: Session, folder: Path) -> Session:
    """Make a folder with links to the recordings of a session that may not be written; copies on a drive without links.

    Labels, checks and datasets are then next to the links. A folder that was made so before is completed.

    Raises:
        UsageError: If the folder holds recordings of another session.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for original in (*session.episodes, *session.unfinished, session.folder / FILE):
        place = folder / original.name
        if place.exists() and (original.name == FILE or place.stat().st_size == original.stat().st_size):
            continue
        if place.exists():
            raise UsageError(
                f"{place} is not the one of {session.folder}",
                "a new folder, or one of this session",
                "name another --out",
            )
        try:
            if original.name == FILE:
                raise OSError  # the document grows with the folder: a link would lead to the drive
            place.symlink_to(original.resolve())
        except OSError:
            shutil.copyfile(original, place)
    return read_session(folder)


def refresh(session: Session) -> Session:
    """Update the document to the finished recordings of the folder; return the session."""
    # The disk decides: a sync tap may have been added since this session was read.
    document = read_session(session.folder).document
    entries = {entry["number"]: entry for entry in document["episodes"]}
    episodes = [
        entries.get(number, {"number": number, "file": path.name, "code_version": provenance.code_version()})
        for number, path in file_names.finished(session.folder).items()
    ]
    documents.write(session.folder / FILE, {**document, "episodes": episodes}, "session")
    return read_session(session.folder)
