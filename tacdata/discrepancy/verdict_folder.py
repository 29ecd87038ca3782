"""A verdict on disk: the folder that `tacdata discrepancy` writes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from tacdata import documents
from tacdata.discrepancy.run import TEXT, VERDICT
from tacdata.display import Displayed
from tacdata.errors import UsageError
from tacdata.paths import StrPath


@dataclass(frozen=True, repr=False)
class VerdictFolder(Displayed):
    """A verdict with its evidence."""

    folder: Path
    """The folder with the page, the picture and the residuals."""
    document: dict[str, Any]
    """The verdict (`schemas/verdict.schema.json`)."""
    _kept: Any = field(default=None, compare=False)
    """A temporary folder that is deleted with this object; None if the folder is permanent."""

    def __fspath__(self) -> str:
        """Return the folder: functions that take a path take the object, too."""
        return str(self.folder)

    @property
    def status(self) -> str:
        """ "named", "ambiguous", "unknown" or "none"."""
        return self.document["status"]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, the strongest first; empty if none is named."""
        return tuple(entry["effect"] for entry in self.document["effects"])

    @cached_property
    def text(self) -> str:
        """The verdict as text."""
        return (self.folder / TEXT).read_text(encoding="utf-8")

    def description(self) -> Iterator[str]:
        """Yield the verdict: status, effects, reason."""
        yield f"Verdict {self.folder.name}: {self.status}" + (f" ({', '.join(self.effects)})" if self.effects else "")
        yield str(self.document["why"]).splitlines()[0]


def read_verdict(folder: StrPath, temporary: Any = None) -> VerdictFolder:
    """Read a verdict: the folder that `tacdata discrepancy` wrote.

    Args:
        folder: The folder, or the file ``verdict.json`` in it.
        temporary: A temporary folder that is to live as long as the verdict.

    Raises:
        UsageError: If there is no verdict.
        FormatError: If its document is damaged.
    """
    path = Path(folder)
    path = path.parent if path.name == VERDICT else path
    if not (path / VERDICT).is_file():
        raise UsageError(
            f"{path} is no verdict: no {VERDICT} in it", "a folder of tacdata discrepancy", "check the path"
        )
    return VerdictFolder(path, documents.read(path / VERDICT, "verdict"), temporary)
