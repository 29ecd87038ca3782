"""Episodes that a person has set aside, with a reason, in a file of the same folder.

A flag names the recording by its hash, so that it stays true when a dataset is edited or a session packed again.
`tacdata browse` sets flags; whatever learns from a dataset leaves out `flagged_episodes`.
"""

import getpass
import socket
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from tacdata import documents, schemas
from tacdata.dataset.format import metadata
from tacdata.dataset.reader import Dataset
from tacdata.errors import UsageError
from tacdata.paths import StrPath

IN_SESSION, IN_DATASET = Path("flags.json"), Path("meta/tacdata_flags.json")
LONGEST = 500
"""Letters of a reason."""


@dataclass(frozen=True)
class Flag:
    """One episode set aside."""

    recording: str
    """SHA-256 of the recording's file (hex)."""
    file: str
    """Name of the recording."""
    reason: str
    """Why, in words."""
    flagged_at: str = ""
    """Date and time, ISO 8601."""
    flagged_by: str = ""
    """Who set it aside: user@computer."""


@dataclass(frozen=True)
class FlagChange:
    """A flag that was set, or taken away."""

    recording: str
    """SHA-256 of the recording's file (hex)."""
    file: str
    """Name of the recording."""
    reason: str
    """Why it was set aside; empty where it was taken back."""
    by: str
    """Who: user@computer."""
    at: str
    """Date and time, ISO 8601."""


def path_of(folder: Path) -> Path:
    """Return where a session's or dataset's flags lie."""
    return folder / (IN_DATASET if (folder / "meta" / "info.json").is_file() else IN_SESSION)


def read_flags(folder: StrPath) -> dict[str, Flag]:
    """Return the flags of a session or dataset by the recording's hash; none if nothing was ever flagged.

    Raises:
        FormatError: If the file is damaged.
    """
    folder = Path(folder)
    path = path_of(folder)
    if not path.is_file():
        return {}
    return {entry["recording"]: Flag(**entry) for entry in documents.read(path, "flags")["flags"]}


def set_flag(folder: Path, recording: str, file: str, reason: str) -> Flag:
    """Set an episode aside; a reason given before is replaced.

    Args:
        folder: The session or dataset.
        recording: SHA-256 of the recording's file (hex).
        file: Its name.
        reason: Why, in words.

    Raises:
        UsageError: If there is no reason, or a whole story.
        DeviceError: If the disk refuses it.
    """
    # One line, as tables show it.
    reason = " ".join(reason.split())
    if not reason or len(reason) > LONGEST:
        fault = "a flag without a reason" if not reason else f"a reason of {len(reason)} letters"
        raise UsageError(fault, f"1 to {LONGEST} letters", "say in a sentence what is wrong with the episode")
    flag = Flag(recording, file, reason, datetime.now(UTC).isoformat(timespec="seconds"), who())
    change = FlagChange(recording, file, reason, flag.flagged_by, flag.flagged_at)
    _write(folder, read_flags(folder) | {recording: flag}, [change])
    return flag


def clear_flag(folder: Path, recording: str) -> None:
    """Take a flag away; nothing happens where there is none."""
    flags = read_flags(folder)
    if (flag := flags.pop(recording, None)) is not None:
        at = datetime.now(UTC).isoformat(timespec="seconds")
        _write(folder, flags, [FlagChange(recording, flag.file, "", who(), at)])


def read_history(folder: StrPath) -> list[FlagChange]:
    """Return every change of a session's or dataset's flags, the oldest first; those before version 1.1 are not known.

    Raises:
        FormatError: If the file is damaged.
    """
    folder = Path(folder)
    path = path_of(folder)
    entries = documents.read(path, "flags").get("history", []) if path.is_file() else []
    return [FlagChange(**entry) for entry in entries]


def carry_flags(session: Path, dataset: Path) -> list[Flag]:
    """Give a dataset the flags of the session that it was packed from; its own flags stay.

    Args:
        session: Folder of recordings.
        dataset: Folder of the dataset.

    Returns:
        The flags that are new to the dataset, in the order of the session's recordings.

    Raises:
        FormatError: If a file of flags is damaged.
        DeviceError: If the disk refuses it.
    """
    present = read_flags(dataset)
    recordings = {record.recording for record in metadata.read_records(dataset).values()}
    carried = {key: flag for key, flag in read_flags(session).items() if key in recordings and key not in present}
    if carried:
        changes = [change for change in read_history(session) if change.recording in carried]
        _write(dataset, carried | present, changes)
    return list(carried.values())


def flagged_episodes(dataset: Dataset) -> dict[int, str]:
    """Return the flagged episodes of a dataset: number -> reason.

    Raises:
        FormatError: If the file is damaged.
    """
    flags = read_flags(dataset.root)
    return {
        entry.index: flags[entry.record.recording].reason
        for entry in dataset.episodes
        if entry.record is not None and entry.record.recording in flags
    }


def _write(folder: Path, flags: dict[str, Flag], changes: Sequence[FlagChange]) -> None:
    entries = [asdict(flag) for flag in sorted(flags.values(), key=lambda flag: (flag.file, flag.recording))]
    # Only appended to: a flag that was taken back stays traceable.
    history = [asdict(change) for change in (*read_history(folder), *changes)]
    document = {"version": schemas.version("flags"), "flags": entries, "history": history}
    documents.write(path_of(folder), document, "flags")


def who() -> str:
    """Return who works here: user@computer; the user is left out where the system knows none."""
    with suppress(OSError, KeyError):
        return f"{getpass.getuser()}@{socket.gethostname()}"
    return socket.gethostname()
