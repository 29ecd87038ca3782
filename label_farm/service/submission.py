"""Submissions to the service: one file each, in the store, so that no restart loses one."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from tacdata import documents, schemas
from tacdata.errors import FormatError, UsageError

OPEN = ("waiting", "planning", "running")
"""States of a submission that is not finished."""


@dataclass(frozen=True)
class Submission:
    """One session to label; fields by `schemas/submission.schema.json`."""

    session: str
    """Folder of the recordings, from the service's root on."""
    by: str
    """Who asks."""
    priority: int = 0
    """Larger comes first."""
    sensor: str | None = None
    """Sensor file from the root on; None for each recording's own."""
    dataset: str | None = None
    """Dataset that finished labels flow into, from the root on."""
    redo: bool = False
    """Replace labels of another model version, try failed presses again."""
    uncertainty: bool = True
    """Whether labels have uncertainties by the sensor file's spreads."""
    tolerance: float = 0.005
    """States are added where maps between them would be off by more [mm]; 0: none."""
    load_step: float = 0.25
    """Largest depth step while loading [mm]."""
    unload_step: float = 0.75
    """Depth step while unloading [mm] (`label_farm.presses.ladder.Ladder`)."""
    id: str = "000000"
    """Number in its store."""
    submitted_at: str = ""
    """UTC, ISO 8601."""
    finished_at: str | None = None
    """UTC, ISO 8601."""
    state: str = "waiting"
    """``waiting``, ``planning``, ``running``, ``done``, ``cancelled`` or ``refused``."""
    reason: str = ""
    """Why it was refused."""
    episodes: int = 0
    """Recordings of the session."""
    labelled: int = 0
    """Episodes that have a label."""
    failed: int = 0
    """Episodes that have none."""

    @property
    def document(self) -> dict[str, Any]:
        """The submission as plain data."""
        return {"version": schemas.version("submission"), **asdict(self)}

    @classmethod
    def from_document(cls, document: dict[str, Any], origin: str) -> Self:
        """Rebuild a submission.

        Raises:
            FormatError: If it breaks the schema.
        """
        documents.check(document, "submission", origin)
        # Fields of a later minor version are passed over.
        names = {entry.name for entry in fields(cls)}
        return cls(**{key: value for key, value in document.items() if key in names})


class Submissions:
    """The submissions of one store. One service at a time writes here."""

    def __init__(self, store: Path) -> None:
        """Open the folder in the store, or make it."""
        self.folder = store / "submissions"
        self.folder.mkdir(exist_ok=True)
        self._all: dict[str, Submission] = {}
        self.damaged: list[str] = []
        for path in sorted(self.folder.glob("*.json")):
            try:
                submission = Submission.from_document(json.loads(path.read_text()), str(path))
                self._all[submission.id] = submission
            except (ValueError, FormatError) as error:
                # One damaged file must not keep the service from starting.
                self.damaged.append(f"{path}: {str(error).splitlines()[0]}")

    def add(self, wish: Submission) -> Submission:
        """Store a submission under the next number; it is on the disk when this returns."""
        # Numbers of files, damaged ones too: none is given twice.
        numbers = [int(p.stem) for p in self.folder.glob("*.json") if re.fullmatch("[0-9]{6}", p.stem)]
        filed = replace(wish, id=f"{max(numbers, default=0) + 1:06d}", submitted_at=now())
        self.keep(filed)
        return filed

    def keep(self, submission: Submission) -> None:
        """Write a submission's present state."""
        documents.write(self.folder / f"{submission.id}.json", submission.document, "submission")
        self._all[submission.id] = submission

    def get(self, number: str) -> Submission:
        """Return a submission.

        Raises:
            UsageError: If there is none of that number.
        """
        if number not in self._all:
            raise UsageError(
                f"no submission {number[:20]!r}", f"one of the {len(self._all)} of this store", "see farm status"
            )
        return self._all[number]

    def listing(self) -> list[Submission]:
        """Return all, the oldest first."""
        return [self._all[number] for number in sorted(self._all)]


def now() -> str:
    """Return the time, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")
