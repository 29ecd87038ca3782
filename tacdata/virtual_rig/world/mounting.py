"""Mounts indenters on a virtual rig, through a small file in the rig's folder."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from typing import Any

from tacdata import documents, schemas
from tacdata.errors import DeviceError, TacdataError, UsageError
from tacdata.indenters import Indenter, from_document
from tacdata.virtual_rig.world.lower_face import LowerFace

POLL = 0.01
"""Interval between two looks at a file [s]."""
LONGEST = 60.0
"""Timeout for mounting an indenter [s]; the distances of a new solid are computed first."""


def mount(
    rig: dict[str, Any] | Path, indenter: dict[str, Any], yaw: float = 0.0, tilt_x: float = 0.0, tilt_y: float = 0.0
) -> None:
    """Mount an indenter on a virtual rig; it is in place when this returns.

    Args:
        rig: A rig file's document with ``mounting: {file: PATH}``, or the directory of a virtual rig.
        indenter: ``{"shape": name, parameter: value, ...}``, as in a plan.
        yaw: Rotation about its own axis in the sensor's frame [deg].
        tilt_x: Tilt of that axis about x [deg], after the yaw and the tilt about y.
        tilt_y: Tilt about y [deg], after the yaw.

    Raises:
        UsageError: If the rig has no mounting file; then a person mounts.
        FormatError: If the indenter is invalid.
        DeviceError: If a rig runs and does not take it.
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
    leans = {name: tilt for name, tilt in (("tilt_x", tilt_x), ("tilt_y", tilt_y)) if tilt}
    document = {"version": schemas.version("mounting"), "indenter": indenter, "yaw": yaw, **leans}
    documents.write(path, document, "mounting")
    status = path.stat()
    mark, end = str((status.st_ino, status.st_mtime_ns)), time.monotonic() + LONGEST
    while taken(path).exists() and taken(path).read_text() != mark:
        if time.monotonic() > end:
            raise DeviceError(
                f"the virtual rig has not taken the indenter in {path}",
                f"one that is in place within {LONGEST:g} s",
                "look at what the rig says, and start it again",
            )
        time.sleep(POLL)


def taken(path: Path) -> Path:
    """Return the file in which a running rig confirms the mounting file that it has read."""
    return path.with_suffix(".taken")


class Mounted:
    """Content of the mounting file, read again when it changes."""

    def __init__(self, path: Path) -> None:
        """Watch a file that may not exist yet."""
        self.path = path
        self.indenter: Indenter | LowerFace | None = None
        self.yaw = 0.0
        self._seen: tuple[int, int] | None = None
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="virtual-mounting", daemon=True)

    def start(self) -> None:
        """Watch the file in a thread and confirm the mounted indenter; reading a solid takes seconds."""
        # The indenter of an earlier run is not on this rig.
        self.path.unlink(missing_ok=True)
        taken(self.path).write_text("nothing")
        self._thread.start()

    def stop(self) -> None:
        """Stop watching."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=30.0)
            taken(self.path).unlink(missing_ok=True)

    def look(self) -> None:
        """Read the mounted indenter: one `stat`, and a read if the file has changed."""
        try:
            status = self.path.stat()
            if (mark := (status.st_ino, status.st_mtime_ns)) == self._seen:
                return
        except FileNotFoundError:
            self.indenter, self._seen = None, None
            return
        document = documents.read(self.path, "mounting")
        indenter = from_document(document["indenter"], str(self.path))
        tilts = [float(document.get(name, 0.0)) for name in ("tilt_x", "tilt_y")]
        if any(tilts):
            # The tilted axis is fixed in the sensor's frame: the table includes the yaw.
            self.indenter, self.yaw = LowerFace.of(indenter, float(document["yaw"]), *tilts), 0.0
        else:
            self.indenter = LowerFace.upright(indenter) if indenter.shape == "mesh" else indenter
            self.yaw = float(document["yaw"])
        self._seen = mark

    def _watch(self) -> None:
        while not self._stopped.wait(POLL):
            snapshot = self._seen
            try:
                self.look()
            except TacdataError as error:  # whoever mounts reads in its answer that the file was refused
                print(error, file=sys.stderr, flush=True)
            if self._seen != snapshot:
                taken(self.path).write_text(str(self._seen))
