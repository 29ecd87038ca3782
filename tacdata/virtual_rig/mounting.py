"""The operator's hand: which indenter is mounted, said through a small file beside the rig."""

from __future__ import annotations

import math
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import schemas
from tacdata import documents
from tacdata.errors import DeviceError, TacdataError, UsageError
from tacdata.indenters import Indenter, from_document

POLL = 0.01
"""Time between two looks at a file [s]."""
LONGEST = 60.0
"""Longest time that taking an indenter may last [s]: a new solid's distances are computed first."""
SPACING = 0.05
"""Between samples of a solid's lower surface [mm]."""
FAR = 100.0
"""Height that stands for no solid [mm]."""


def mount(rig: dict[str, Any] | Path, indenter: dict[str, Any], yaw: float = 0.0) -> None:
    """Mount an indenter on a virtual rig; it is in place when this returns.

    Args:
        rig: A rig file's document with ``mounting: {file: PATH}``, or the directory of a virtual rig.
        indenter: ``{"shape": name, parameter: value, ...}``, as in a plan.
        yaw: Rotation about z in the sensor's frame [deg].

    Raises:
        UsageError: If the rig has no mounting file: there a person mounts.
        FormatError: If the indenter is none.
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
    documents.write(path, {"version": schemas.version("mounting"), "indenter": indenter, "yaw": yaw}, "mounting")
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
    """Return the file in which a running rig says which mounting file it has taken."""
    return path.with_suffix(".taken")


class Mounted:
    """What the mounting file says, read anew when it changes."""

    def __init__(self, path: Path) -> None:
        """Watch a file that may not exist yet."""
        self.path = path
        self.indenter: Indenter | Lowest | None = None
        self.yaw = 0.0
        self._seen: tuple[int, int] | None = None
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="virtual-mounting", daemon=True)

    def start(self) -> None:
        """Watch the file in a thread of its own and say what was taken: reading a solid from a file takes seconds."""
        self.path.unlink(missing_ok=True)
        taken(self.path).write_text("nothing")
        self._thread.start()

    def stop(self) -> None:
        """Watch no more."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(timeout=30.0)
            taken(self.path).unlink(missing_ok=True)

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
        indenter = from_document(document["indenter"], str(self.path))
        self.indenter = Lowest.of(indenter) if indenter.shape == "mesh" else indenter
        self.yaw, self._seen = float(document["yaw"]), mark

    def _watch(self) -> None:
        while not self._stopped.wait(POLL):
            before = self._seen
            try:
                self.look()
            except TacdataError as error:  # whoever mounts is told that it was not taken
                print(error, file=sys.stderr, flush=True)
            if self._seen != before:
                taken(self.path).write_text(str(self._seen))


@dataclass(frozen=True)
class Lowest:
    """The lower surface of a solid from a file as a table: the solid itself answers too slowly for a stream."""

    extent: float
    """Largest horizontal distance of the solid from its axis [mm]."""
    heights: np.ndarray
    """Height over a square of twice the extent [mm], shape (n, n); ``FAR`` beside the solid."""

    @classmethod
    def of(cls, indenter: Indenter) -> Lowest:
        """Sample an indenter every `SPACING`."""
        n = 2 * math.ceil(indenter.extent / SPACING) + 1
        line = np.linspace(-indenter.extent, indenter.extent, n)
        x, y = np.meshgrid(line, line, indexing="ij")
        return cls(indenter.extent, np.minimum(indenter.profile(x, y), FAR))

    def profile(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the height [mm] over (x, y) [mm], linear between the samples; `FAR` beside them."""
        last = len(self.heights) - 1
        i, j = ((np.asarray(v) / self.extent + 1) * last / 2 for v in (x, y))
        beside = (i < 0) | (i > last) | (j < 0) | (j > last)
        a, b = (np.clip(np.floor(v).astype(int), 0, last - 1) for v in (i, j))
        s, t = np.clip(i - a, 0, 1), np.clip(j - b, 0, 1)
        h = self.heights
        low, high = (1 - t) * h[a, b] + t * h[a, b + 1], (1 - t) * h[a + 1, b] + t * h[a + 1, b + 1]
        return np.where(beside, FAR, (1 - s) * low + s * high)
