"""The reason why a press has no label, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tacdata import documents, provenance, schemas
from tacdata.label_farm.presses.job import Job
from tacdata.paths import StrPath


@dataclass(frozen=True)
class Failure:
    """Why a press has no label."""

    kind: str
    """``recording``, ``solve`` or ``crash`` (`schemas/label_failure.schema.json`)."""
    reason: str
    """For a person."""
    log: str = ""
    """Traceback or last lines of the worker's log."""
    tries: int = 1
    """How often it was tried."""

    def document(self, job: Job | None) -> dict[str, Any]:
        """The failure as plain data."""
        return {
            "version": schemas.version("label_failure"),
            "key": job.key if job else None,
            "job": job.document if job else None,
            "kind": self.kind,
            "reason": self.reason,
            "log": self.log,
            "tries": self.tries,
            "failed_at": datetime.now(UTC).isoformat(timespec="seconds"),
            "code_version": provenance.code_version(),
        }

    @classmethod
    def read(cls, path: StrPath) -> Failure:
        """Read a failure's file.

        Raises:
            FormatError: If it is damaged or of another version.
        """
        path = Path(path)
        document = documents.read(path, "label_failure")
        return cls(document["kind"], document["reason"], document.get("log", ""), document.get("tries", 1))
