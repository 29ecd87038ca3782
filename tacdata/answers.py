"""Answers that cost seconds, kept in the user's cache by a hash of everything that decides them.

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


def recall(kind: str, key: str) -> Any | None:
    """Return an answer (JSON types) that was kept, None without an intact one.

    Args:
        kind: Folder of answers of one kind.
        key: Hash of all that decides it (hex).
    """
    try:
        checksum, _, text = _place(kind, key).read_text(encoding="utf-8").partition("\n")
        return json.loads(text) if checksum == _checksum(text) else None
    except (OSError, ValueError):
        return None


def keep(kind: str, key: str, answer: Any) -> None:
    """Keep an answer (JSON types); of two processes that keep one at a time, the later decides."""
    text = json.dumps(answer)
    with suppress(OSError), replacement(_place(kind, key), settled=False) as stream:
        stream.write(f"{_checksum(text)}\n{text}".encode())


def _place(kind: str, key: str) -> Path:
    return cache_folder() / "answers" / kind / key


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
