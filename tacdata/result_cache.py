"""Cache of small results that cost seconds: JSON values by a hash of everything that decides them.

An entry is never changed. A damaged one counts as none, and so does a cache that cannot be written: results are the
same, only later.
"""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from tacdata.paths import cache_folder
from tacdata.replacement import replacement


def load(kind: str, key: str) -> Any | None:
    """Return a stored value (JSON types), None without an intact one.

    Args:
        kind: Folder of values of one kind.
        key: Hash of all that decides it (hex).
    """
    try:
        # The checksum in the first line: a file that a crash cut short counts as none.
        checksum, _, text = _place(kind, key).read_text(encoding="utf-8").partition("\n")
        return json.loads(text) if checksum == _checksum(text) else None
    except (OSError, ValueError):
        return None


def store(kind: str, key: str, value: Any) -> None:
    """Store a value (JSON types); of two processes that store one, the later decides."""
    text = json.dumps(value)
    with suppress(OSError), replacement(_place(kind, key), settled=False) as stream:
        stream.write(f"{_checksum(text)}\n{text}".encode())


def _place(kind: str, key: str) -> Path:
    return cache_folder() / "results" / kind / key


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
