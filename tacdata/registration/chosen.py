"""Chooses the registration of a session and warns about it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from tacdata import documents
from tacdata.errors import FormatError
from tacdata.rig import Rig
from tacdata.sensor import Sensor

FILE = "registration.yaml"
"""File name of a registration in the folder of a rig file, and of its copy in a session."""
OLD_DAYS = 30
"""Age from which a warning is given [days]."""


@dataclass(frozen=True)
class Chosen:
    """A rig with the registration that will be used."""

    rig: Rig
    path: Path | None
    """The registration's file; None if the rig file's own is used."""
    warnings: tuple[str, ...]
    """Warnings for a person, as sentences."""

    def keep(self, session: Path) -> None:
        """Copy the registration's file into a session's folder, unless a copy is there."""
        if self.path is not None and session.is_dir() and not (session / FILE).exists():
            documents.write_text(session / FILE, self.path.read_text())


def chosen_registration(rig: Rig, rig_path: Path, path: Path | None, sensor: Sensor) -> Chosen:
    """Return the rig with a measured registration: the named file, or the one in the rig file's folder.

    Args:
        rig: The rig, with the registration of its own file.
        rig_path: That file.
        path: A registration file; None: `FILE` in the rig file's folder, if there is one.
        sensor: The sensor that will be pressed.

    Raises:
        UsageError: If the file does not exist, or belongs to another rig or sensor.
        FormatError: If it is damaged.
    """
    default_path = rig_path.with_name(FILE)
    # A registration beside the rig file is that rig's, unless another is named.
    path = path or (default_path if default_path.is_file() else None)
    if path is None:
        return Chosen(rig, None, (_unmeasured(rig, rig_path),))
    document = documents.read(path, "registration")
    registered = rig.registered(document, sensor.content_hash, str(path))
    warnings = [f"registration: {path}, measured {document['date']}"]
    try:
        age = datetime.now(UTC) - datetime.fromisoformat(document["date"])
    except (ValueError, TypeError):
        raise FormatError(f"{path}: date {document['date']!r}", "ISO 8601 with a time zone", "register again") from None
    if age.days > OLD_DAYS:
        warnings.append(f"WARNING: the registration is {age.days} days old; register again if anything moved")
    # Without homing, machine coordinates begin at a new zero after every power-on.
    if document["controller"].get("$22") == "0":
        warnings.append("WARNING: it was measured without homing ($22=0): valid only if the controller kept its power")
    return Chosen(registered, path, tuple(warnings))


def _unmeasured(rig: Rig, rig_path: Path) -> str:
    entry = rig.document["registration"]
    remedy = f"next: tacdata register --rig {rig_path}"
    if entry.get("method") and entry.get("date"):
        return (
            f"WARNING: no registration was measured; places and depths rest on the rig file's own "
            f"({entry['method']}, {entry['date']}), whose errors are not known\n  {remedy}"
        )
    return (
        "WARNING: THE SENSOR IS NOT REGISTERED to the guide: places and depths rest on a guess in the rig file, and "
        f"labels of these recordings will be wrong by as much as the guess\n  {remedy}"
    )
