"""Keeps paths that came over the network under one folder."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from tacdata.errors import UsageError

LONGEST = 255
"""Bytes that a file system takes for a name."""


def confined(root: Path, requested: str, what: str) -> Path:
    """Return the path under ``root`` that was asked for, links followed.

    Raises:
        UsageError: If it is absolute, has dots, or leads out of the root.
    """
    parts = PurePosixPath(requested)
    refused = UsageError(
        f"{what} {requested[:200]!r}",
        "a path inside the folder that the service serves",
        f"name it from {root.name}/ on",
    )
    if not requested or "\0" in requested or "\\" in requested or parts.is_absolute() or ".." in parts.parts:
        raise refused
    if any(len(part.encode(errors="replace")) > LONGEST for part in parts.parts):
        raise refused
    try:
        path = (root / parts).resolve()
    except (OSError, ValueError, RuntimeError):
        raise refused from None
    if not path.is_relative_to(root.resolve()):
        raise refused
    return path
