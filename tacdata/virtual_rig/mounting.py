"""The operator's hand: which indenter is mounted, said through a small file beside the rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import schemas
from tacdata import documents
from tacdata.errors import UsageError
from tacdata.indenters import Indenter, from_document


def mount(rig: dict[str, Any] | Path, indenter: dict[str, Any], yaw: float = 0.0) -> None:
    """Mount an indenter on a virtual rig; it is in place when this returns.

    Args:
        rig: A rig file's document with ``mounting: {file: PATH}``, or the directory of a virtual rig.
        indenter: ``{"shape": name, parameter: value, ...}``, as in a plan.
        yaw: Rotation about z in the sensor's frame [deg].

    Raises:
        UsageError: If the rig has no mounting file: there a person mounts.
        FormatError: If the indenter is none.
    """
    if isinstance(rig, dict):
        if "mounting" not in rig:
            raise UsageError(
                f"rig {rig.get('name', '')} names no mounting file",
                "mounting: {file: PATH}, as a virtual rig has",
                "mount the indenter by hand",
            )
        path = Path(rig["mounting"]["file"])
    else:
        path = rig / "mounted.json"
    from_document(indenter, "mounting")
    documents.write(path, {"version": schemas.version("mounting"), "indenter": indenter, "yaw": yaw}, "mounting")


class Mounted:
    """What the mounting file says, read anew when it changes."""

    def __init__(self, path: Path) -> None:
        """Watch a file that may not exist yet."""
        self.path = path
        self.indenter: Indenter | None = None
        self.yaw = 0.0
        self._seen: tuple[int, int] | None = None

    def look(self) -> None:
        """Take over what is mounted now: one `stat`, and a read if the file is another one."""
        try:
            status = self.path.stat()
            if (mark := (status.st_ino, status.st_mtime_ns)) == self._seen:
                return
        except FileNotFoundError:
            self.indenter, self._seen = None, None
            return
        document = documents.read(self.path, "mounting")
        self._seen = mark
        self.indenter = from_document(document["indenter"], str(self.path))
        self.yaw = float(document["yaw"])
