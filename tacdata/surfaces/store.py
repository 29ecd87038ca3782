"""Stores surface files by content, so that a document names a shape by its hash and no path."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from tacdata import provenance
from tacdata.errors import FormatError, UsageError
from tacdata.paths import cache_folder


def keep(path: Path) -> str:
    """Store a copy of a surface file; return its SHA-256 (hex, 64 characters)."""
    digest = provenance.file_hash(path)
    copy = _kept(digest, path.name)
    if not copy.is_file():
        copy.parent.mkdir(parents=True, exist_ok=True)
        temporary = copy.with_name(f".{copy.name}.{os.getpid()}")
        shutil.copyfile(path, temporary)
        temporary.replace(copy)
    return digest


def find(file: str, digest: str, what: str) -> Path:
    """Return a surface file of that content, from the store or by name from the folders in ``TACDATA_SHAPES``.

    Raises:
        UsageError: If it is not found.
        FormatError: If a file of that name has another content.
    """
    copy = _kept(digest, file)
    if copy.is_file():
        return copy
    for folder in filter(None, os.environ.get("TACDATA_SHAPES", "").split(os.pathsep)):
        path = Path(folder) / Path(file).name
        if path.is_file():
            if provenance.file_hash(path) != digest:
                raise FormatError(
                    f"{what} surface {path} is not the file that was used (SHA-256 {digest[:12]} wanted)",
                    "the same file, byte by byte",
                    "put the original there",
                )
            return _kept(keep(path), file)
    raise UsageError(
        f"{what} surface {file} (SHA-256 {digest[:12]}) is not on this machine",
        "a file that was read here before, or one in a folder named by TACDATA_SHAPES",
        f"copy {Path(file).name} into a folder and set TACDATA_SHAPES to it",
    )


def _kept(digest: str, file: str) -> Path:
    return cache_folder() / "shapes" / f"{digest}{Path(file).suffix.lower()}"
