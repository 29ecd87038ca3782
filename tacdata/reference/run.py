"""From two machines' sessions to a folder with their difference."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tacdata import documents
from tacdata.discrepancy.heading import unit_of
from tacdata.discrepancy.run import recording_hash
from tacdata.errors import UsageError
from tacdata.reference import picture
from tacdata.reference.difference import Difference, difference
from tacdata.reference.report import Machines, document, text
from tacdata.reference.sessions import read_sessions

DOCUMENT, TEXT, PICTURE = "difference.json", "difference.txt", "difference.png"
"""Files of the folder."""


@dataclass(frozen=True)
class Compared:
    """A difference with its heading and its document."""

    found: Difference
    heading: Machines
    document: dict[str, Any]
    """As in the file (`schemas/difference.schema.json`)."""

    @property
    def text(self) -> str:
        """It for reading in a terminal."""
        return text(self.found, self.heading)


def compare(measured: list[Path], healthy: list[Path]) -> Compared:
    """Compare a machine with a healthy one.

    Args:
        measured: Recordings or sessions of the machine that is judged.
        healthy: Those of the healthy machine.

    Raises:
        UsageError: If a path is given as both, or holds nothing.
        FormatError: If the sessions hold no presses of the same kind.
    """
    sessions = read_sessions(healthy, measured)
    unit, recorded = unit_of(measured[0])
    heading = Machines(tuple(map(str, measured)), tuple(map(str, healthy)), recorded, unit)
    result = difference(sessions.course, sessions.names, sessions.measured)
    sides = (("recording", measured), ("reference", healthy))
    parents = {f"{side} {path}": recording_hash(path) for side, paths in sides for path in paths}
    return Compared(result, heading, document(result, heading, parents))


def write(compared: Compared, target: Path) -> None:
    """Write document, text and picture to a new folder.

    Raises:
        UsageError: If it exists.
    """
    if target.exists():
        raise UsageError(f"{target} exists", "a new folder", "choose another --out")
    target.mkdir(parents=True)
    documents.write(target / DOCUMENT, compared.document, "difference")
    documents.write_text(target / TEXT, compared.text)
    title = f"{', '.join(Path(p).name for p in compared.heading.measured)} compared with "
    title += ", ".join(Path(p).name for p in compared.heading.healthy)
    picture.draw(compared.found, compared.heading.unit, title, target / PICTURE)
