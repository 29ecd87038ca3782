"""The content of a kind's file: a test whether a path is of this kind, and its scene.

``viewers/kinds/my_kind.py`` defines one class derived from `Kind`; `viewers.source` asks every kind in the order of
`ORDER`, the narrowest first.
"""

import os
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar

from tacdata import registry
from tacdata.errors import UsageError
from tacdata.viewers.scene.request import Asked
from tacdata.viewers.scene.scene import Scene

ROOM, BASE = "tacdata.viewers.kinds", "kind"


class Kind(ABC):
    """A kind of path that can be viewed."""

    ORDER: ClassVar[int]
    """Its place among the kinds: those that ask for less of a path come later."""
    NOUN: ClassVar[str]
    """Its name in messages."""

    @abstractmethod
    def claims(self, path: Path) -> bool:
        """Return whether a path is of this kind, by its name and the files in it; nothing large is read."""

    def holds(self, path: Path) -> bool:
        """Return whether a path that it claims has something to show."""
        return path.exists()

    @abstractmethod
    def scene(self, path: Path, options: Asked) -> Scene:
        """Return the scene.

        Raises:
            UsageError: If the requested part is missing, or not applicable to this kind.
            FormatError: If a file is damaged.
        """


def kinds() -> list[Kind]:
    """Return one of every kind, the narrowest first."""
    members: list[Any] = [registry.load(ROOM, BASE, name, Kind) for name in registry.names(ROOM, BASE)]
    # Narrow kinds first: every folder would pass for a session.
    instances: list[Kind] = [member() for member in members]
    return sorted(instances, key=lambda kind: kind.ORDER)


def kind_of(path: Path) -> Kind:
    """Return the kind of a path.

    Raises:
        UsageError: If there is nothing, or nothing that can be viewed.
    """
    members = kinds()
    for kind in members if path.exists() else ():
        if kind.claims(path):
            return kind
    fault = f"{path} is no recording, nor anything else that can be viewed" if path.exists() else ""
    raise UsageError(
        fault or f"no file or folder {path}", "; ".join(dict.fromkeys(k.NOUN for k in members)), "check the path"
    )


DEEPEST = 2
"""Levels of folders below a named one that are searched."""


def contents(folder: Path) -> dict[Path, Kind]:
    """Return the viewable contents of a folder that holds no recordings itself, by path."""
    members = kinds()
    entries: dict[Path, Kind] = {}
    level = [folder]
    for _ in range(DEEPEST):
        # What lies inside an entry is part of it: a session of thousands of files is not walked through.
        level = [child for parent in level if parent not in entries for child in _folders(parent)]
        for path in level:
            kind = next((kind for kind in members if kind.claims(path) and kind.holds(path)), None)
            if kind is not None:
                entries[path] = kind
    return entries


def _folders(parent: Path) -> list[Path]:
    """Return the folders in a folder, by name; none of a folder that may not be read."""
    try:
        with os.scandir(parent) as found:
            return sorted(parent / entry.name for entry in found if entry.is_dir() and not entry.name.startswith("."))
    except OSError:
        return []


def refuse(options: Asked, noun: str, *allowed: str) -> None:
    """Refuse options that mean nothing for a kind.

    Raises:
        UsageError: Naming the first of them.
    """
    for name in ("labels", "predictions", "episode"):
        value = getattr(options, name)
        if value is not None and name not in allowed:
            raise UsageError(
                f"--{name} {value} with {noun}",
                " or ".join(f"--{n}" for n in allowed) or "neither",
                f"leave --{name} out",
            )
