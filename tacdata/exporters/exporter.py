"""Base class of an export format.

``tacdata/exporters/my_robot.py`` defines one class derived from `Exporter`; ``tacdata export --format my_robot`` finds
it by its file's name. `write` makes a new folder from targets and `read` returns the same targets. So a person can look
at a robot's targets, and the tests compare both for every format.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.replay.targets import FingertipTargets

ROOM, BASE = "tacdata.exporters", "exporter"


class Exporter(ABC):
    """Base class: a format that a robot reads."""

    needs_robot = False
    """Whether `write` needs a robot file (`schemas/robot.schema.json`)."""

    def __init__(self, robot: Path | None = None, recordings: Path | None = None) -> None:
        """Keep the robot file and the folder of the recordings, where there are any; the latter hold the images."""
        self.robot, self.recordings = robot, recordings
        self.tables: list[str] = []
        """Tables for a person: a robot's targets of each demonstration."""
        self.remarks: list[str] = []
        """Remarks on the files that `write` made; none of them makes a file unfit."""

    @abstractmethod
    def write(self, episodes: Sequence[FingertipTargets], directory: Path) -> list[str]:
        """Write a new folder.

        Args:
            episodes: Targets, one per demonstration.
            directory: The folder; it does not exist.

        Returns:
            Impossible targets of a robot, as sentences.

        Raises:
            UsageError: If something that the format needs is missing.
            DeviceError: If the disk refuses it.
        """

    @abstractmethod
    def read(self, directory: Path) -> list[FingertipTargets]:
        """Return the targets of a folder that `write` made.

        Raises:
            UsageError: If there is none.
            FormatError: If it is damaged.
        """


def new_folder(directory: Path) -> None:
    """Make a folder that did not exist.

    Raises:
        UsageError: If it exists or cannot be made.
    """
    if directory.exists():
        raise UsageError(f"{directory} exists", "a new folder; nothing is overwritten", "choose another --out")
    try:
        directory.mkdir(parents=True)
    except OSError as error:
        fault = f"{directory} cannot be made: {error.strerror}"
        raise UsageError(fault, "a place to write", "choose another --out") from None


def exporter(name: str, robot: Path | None = None, recordings: Path | None = None) -> Exporter:
    """Return the exporter of a format, given a robot file and the folder of the recordings, if there are any.

    Raises:
        UsageError: If there is no such format, or it needs a robot file.
    """
    kind: Any = registry.load(ROOM, BASE, name, Exporter)
    writer: Exporter = kind(robot, recordings)
    # Here and not in `write`: a person should read it before minutes of work.
    if writer.needs_robot and robot is None:
        raise UsageError(f"format {name} without a robot", "--robot ROBOT.yaml", "describe the robot in a file")
    return writer
