"""A folder of recorded demonstrations."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.demonstrations.recording.rig import DemoRig, demo_rig_of
from tacdata.errors import UsageError
from tacdata.paths import StrPath
from tacdata.recording.files import file_names

FILE = "demonstrations.json"


@dataclass(frozen=True)
class DemoSession:
    """A folder of demonstrations: its recordings and its document."""

    folder: Path
    episodes: tuple[Path, ...]
    """Finished recordings, by number."""
    unfinished: tuple[Path, ...]
    """Recordings that were interrupted; readable."""
    rig: DemoRig
    document: dict[str, Any]
    """Content of `FILE` (`schemas/demo_session.schema.json`)."""

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.document["task"]

    @property
    def next(self) -> Path:
        """The path of the next recording."""
        return file_names.episode(self.folder, 1 + max(file_names.finished(self.folder), default=-1))


def read_demo_session(folder: StrPath) -> DemoSession:
    """Read a folder of demonstrations.

    Raises:
        UsageError: If it is none.
        FormatError: If its document is damaged.
    """
    folder = Path(folder)
    if not (folder / FILE).is_file():
        raise UsageError(
            f"{folder} holds no demonstrations: no {FILE} in it",
            "a folder written by tacdata record --demo",
            "check the path",
        )
    document = documents.read(folder / FILE, "demo_session")
    return DemoSession(
        folder,
        tuple(file_names.finished(folder).values()),
        tuple(file_names.unfinished(folder)),
        demo_rig_of(document["rig"], str(folder / FILE)),
        document,
    )


def open_demo_session(folder: Path, rig: DemoRig, task: str, resume: bool) -> DemoSession:
    """Create a folder for demonstrations, or continue an existing one.

    Raises:
        UsageError: If it exists (does not exist, resuming), or holds another task or rig's demonstrations.
        DeviceError: If the disk refuses it.
    """
    if resume:
        session = read_demo_session(folder)
        # A virtual rig has a new clock and new ports at every start; they do not matter for the recordings.
        for what in ("fingers", "sensors"):
            if session.document["rig"][what] != rig.document[what]:
                raise UsageError(
                    f"{folder} was begun with other {what}", f"the same {what}", "begin a new folder for this rig"
                )
        if session.task != task:
            fault = f"{folder} holds demonstrations of {session.task!r}, not of {task!r}"
            raise UsageError(fault, "one task per folder", "choose another --out")
        return session
    if Path(folder).exists():
        raise UsageError(f"{folder} exists", "a new folder", "choose another --out, or add to it with --resume")
    document = {
        "version": schemas.version("demo_session"),
        "code_version": provenance.code_version(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "task": task,
        "rig": rig.document,
        "sensors": {name: sensor.document for name, sensor in rig.sensors.items()},
        "episodes": [],
    }
    documents.write(folder / FILE, document, "demo_session")
    return read_demo_session(folder)


def refresh(session: DemoSession) -> DemoSession:
    """Update the document to the finished recordings of the folder; return the session."""
    entries = {entry["number"]: entry for entry in session.document["episodes"]}
    episodes = [
        entries.get(number, {"number": number, "file": path.name, "code_version": provenance.code_version()})
        for number, path in file_names.finished(session.folder).items()
    ]
    documents.write(session.folder / FILE, {**session.document, "episodes": episodes}, "demo_session")
    return read_demo_session(session.folder)
