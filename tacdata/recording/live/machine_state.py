"""Where each machine was left, in a file of the user's state directory, so that every program and session knows it."""

from __future__ import annotations

import hashlib
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, schemas
from tacdata.devices.device import MotionController
from tacdata.errors import FormatError, UsageError
from tacdata.recording.motion.move_times import report_resolution
from tacdata.rig import Rig
from tacdata.wire.serial_port import usb_identity

SCHEMA = "machine_state"
FIRMWARE = ("FIRMWARE", "VER", "OPT")
"""Answers of `MotionController.settings` that identify a controller."""
UNKNOWN = "there is no record of where the machine was left"


def state_directory(rig: Rig) -> Path:
    """Return the folder of all machine states.

    The rig file's ``state_directory`` decides, then ``$TACDATA_STATE``, then the platform's directory for state. Users
    of one machine should share a directory.
    """
    directory = rig.document.get("state_directory")
    return Path(directory).expanduser() if directory else own_state_directory()


def own_state_directory() -> Path:
    """Return the folder of states where no rig file names one."""
    if directory := os.environ.get("TACDATA_STATE"):
        return Path(directory).expanduser()
    home = {
        "win32": os.environ.get("LOCALAPPDATA") or "~/AppData/Local",
        "darwin": "~/Library/Application Support",
    }.get(sys.platform, os.environ.get("XDG_STATE_HOME") or "~/.local/state")
    return Path(home).expanduser() / "tacdata" / "machines"


class MachineState:
    """The state of one machine: position at rest, whether it moves, and why its position was lost.

    A file is found by controller identity with the port, its name in the rig file, or the USB serial number. It is
    written before a motion, after it, and at the end; a crash leaves the mark of a motion.

    Example:
        ``state = MachineState(rig, cnc); state.moving(); ...; state.rest()``
    """

    def __init__(self, rig: Rig, cnc: MotionController) -> None:
        """Prepare; nothing is read before the controller is open."""
        self._directory, self._cnc = state_directory(rig), cnc
        self._name = port = str(rig.cnc.get("port", ""))
        # Two names of one port, such as a link in /dev/serial/by-id, must find one record.
        self._port = os.path.realpath(port) if os.path.exists(port) else port
        self._driver = rig.cnc["driver"]
        self._document: dict[str, Any] | None = None
        self._identity: dict[str, str] | None = None
        self._unnamed: list[Path] = []
        self._trusted = False  # whether the reported position was accepted since the opening

    @property
    def is_known(self) -> bool:
        """Whether the machine was met before."""
        return bool(self._read())

    @property
    def loss(self) -> str:
        """Why the position was lost, by the record; empty if it was not, or if nothing was read yet."""
        return (self._document or {}).get("lost", {}).get("why", "")

    @property
    def why_lost(self) -> str:
        """Why the position is unknown by the record alone, in words; empty if it is known, or without a record."""
        document = self._read()
        if self.loss:
            return self.loss
        if document.get("moving"):
            place = f", near {_text(document['position'])} mm" if "position" in document else ""
            return f"a program ended while the machine moved{place} (a power cut, or it was killed)"
        return ""

    @property
    def difference(self) -> str:
        """How the reported position differs from the recorded one, in words; empty if it does not."""
        record, report = self._read().get("position"), self._cnc.reported
        if record is None or report is None:
            return ""
        resolution = float(np.linalg.norm(report_resolution(self._cnc.settings())))
        if np.linalg.norm(np.subtract(report, record)) <= resolution:
            return ""
        return f"the controller reports {_text(report)} mm, and the machine was left at {_text(record)} mm"

    @property
    def lost_since(self) -> str:
        """When the position was lost, by the record; empty if it was not."""
        return self._read().get("lost", {}).get("since", "")

    def moving(self) -> None:
        """Mark a motion that is about to begin.

        Raises:
            DeviceError: If the mark cannot be written.
        """
        if not self._read().get("moving"):
            self._write(moving=True)

    def rest(self) -> None:
        """Record that the machine is at rest where it reports to be."""
        self._write(moving=False)

    def close(self) -> None:
        """Record the last position, unless it was never accepted or a motion was never seen to end."""
        if self._trusted and not self._read().get("moving"):
            self.rest()

    def lose(self, why: str) -> None:
        """Record that the position is unknown, and why; the first reason stays."""
        if "lost" not in self._read():
            self._write(lost={"since": _now(), "why": why})

    def find(self) -> None:
        """Record that the position is known again, and the machine at rest."""
        self._document = {key: value for key, value in self._read().items() if key != "lost"}
        self._trusted = True
        self.rest()
        for path in self._unnamed:
            path.unlink(missing_ok=True)

    def _read(self) -> dict[str, Any]:
        if self._document is None:
            self._identity = self._identify()
            records = {path: _record(path) for path in self._directory.glob("*.json")}
            ours = [record for record in records.values() if self._is_ours(record)]
            # A change of port leaves several records of one machine; the latest counts.
            self._document = dict(max(ours, key=lambda record: record["number"], default={}))
            # A line that broke at opening: the loss was recorded before the controller stated who it is.
            named = self._identity["firmware"]
            self._unnamed = [path for path, record in records.items() if named and self._is_nobodys(record)]
            for path in self._unnamed:
                self._document.setdefault("lost", records[path].get("lost"))
        return self._document

    def _identify(self) -> dict[str, str]:
        answers = self._cnc.settings()
        firmware = " ".join(answers[tag] for tag in FIRMWARE if tag in answers)
        return {"driver": self._driver, "firmware": firmware, "usb": usb_identity(self._port)}

    def _is_nobodys(self, record: dict[str, Any]) -> bool:
        """Whether a record states a loss at this port, of a controller that was not identified."""
        here = record.get("port") == self._port or record.get("name") == self._name
        return here and "lost" in record and not record["controller"]["firmware"]

    def _is_ours(self, record: dict[str, Any]) -> bool:
        if not record or record["controller"] != self._identity:
            return False
        # Ports are renumbered when boards are plugged in again, so either name may be the constant one.
        if record["port"] == self._port or record.get("name") == self._name:
            return True
        # Some makers give all boards one serial number: one that is on the other port now is another machine's.
        usb = record["controller"]["usb"]
        return bool(usb) and usb_identity(record["port"]) != usb

    def _write(self, **changes: Any) -> None:
        document = {
            "moving": False,
            **self._read(),
            **changes,
            "version": schemas.version(SCHEMA),
            "port": self._port,
            "name": self._name,
            "controller": self._identity,
            "number": self._read().get("number", 0) + 1,
            "written": _now(),
        }
        if (position := self._cnc.reported) is not None:
            document["position"] = list(position)
        key = hashlib.sha256(repr((self._port, self._identity)).encode()).hexdigest()[:16]
        documents.write(self._directory / f"{key}.json", document, SCHEMA)
        self._document = document


def _record(path: Path) -> dict[str, Any]:
    try:
        return documents.read(path, SCHEMA)
    except (FormatError, UsageError) as error:
        raise FormatError(
            f"{path} cannot be read, so it is unknown where a machine was left ({error.given})",
            "the file as it was written",
            "find the machine's zero again (home it, or touch off), then delete the file",
        ) from None


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _text(position: Any) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in position) + ")"
