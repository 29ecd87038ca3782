"""Writes a new file that is whole or not there at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tacdata.errors import UsageError

RERUN, PICTURE = ".rrd", ".png"
"""Endings of the files."""
FILMS = (".mp4", ".gif")
"""Endings of films."""


def new_file(path: Path, *suffixes: str) -> Path:
    """Return ``path`` if it can become a new file.

    Raises:
        UsageError: If it exists, or has none of the endings ``suffixes``.
    """
    if path.suffix not in suffixes:
        allowed = f"a name that ends in {' or '.join(suffixes)}"
        raise UsageError(f"output file {path}", allowed, f"use {path.with_suffix(suffixes[0])}")
    if path.exists():
        raise UsageError(f"{path} exists", "a new file", "choose another name, or delete it")
    return path


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """Yield a temporary name in the same folder; on success it becomes ``path``, else it is removed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder, since a rename to another drive is not atomic.
    temporary = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
