"""A small recorded session that ships with tacdata."""

from pathlib import Path

from tacdata.example import copy_session
from tacdata.paths import StrPath
from tacdata.recording.session import Session, read_session


def example_session(folder: StrPath = "example") -> Session:
    """Copy the shipped session, two labelled presses, to a new folder and open it.

    Raises:
        UsageError: If the folder exists.
        DeviceError: If the disk refuses it.

    Example:
        >>> import tacdata as td
        >>> len(td.example_session("a first look"))
        2
    """
    return read_session(copy_session(Path(folder)))
