"""Who made this: content hashes, the code's version, and the stamp that every product carries."""

from __future__ import annotations

import hashlib
import json
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any


def canonical(document: Any) -> str:
    """Return the one JSON text of a document: sorted keys, no spaces, exact floats."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)


def content_hash(document: Any) -> str:
    """Return the SHA-256 of a document's canonical JSON (hex, 64 characters)."""
    return hashlib.sha256(canonical(document).encode()).hexdigest()


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file's bytes (hex, 64 characters)."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def source_hash(package: str) -> str:
    """Return the SHA-256 of a package's Python sources: the part of the code version that decides a result."""
    import importlib

    root = Path(next(iter(importlib.import_module(package).__path__)))
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def code_version() -> str:
    """Return the release and its commit, for example ``0.1.0+g1a2b3c4`` (``.dirty`` if edited).

    A clone is asked for the commit. A wheel carries what was said when it was built (.dev/commit_hook.py).
    """
    try:
        release = version("tacdata")
    except PackageNotFoundError:
        release = "0+unknown"
    carried = Path(__file__).resolve().with_name("commit.txt")
    if carried.is_file():
        return f"{release}+g{carried.read_text().strip()}"
    root = Path(__file__).resolve().parent.parent
    if not (root / ".git").exists():
        return release
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty=.dirty", "--exclude=*"],
            cwd=root, capture_output=True, text=True, check=True, timeout=10,
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return release
    return f"{release}+g{described}"


def stamp(made_by: str, parents: dict[str, str], parameters: dict[str, Any]) -> dict[str, Any]:
    """Return the provenance of a product.

    Args:
        made_by: The verb or function that made it.
        parents: Name to content hash of everything that it was made from.
        parameters: Settings that decided the result (JSON types).
    """
    return {
        "made_by": made_by,
        "code_version": code_version(),
        "made_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "parents": parents,
        "parameters": parameters,
    }
