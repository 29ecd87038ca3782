"""An index of a session's recordings: the press that each needs, and whether its label is current."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

TABLES = """
CREATE TABLE IF NOT EXISTS known (
    recording TEXT PRIMARY KEY, source TEXT, own INTEGER, skin TEXT, made TEXT, hash TEXT, job TEXT, label TEXT
);
CREATE INDEX IF NOT EXISTS used ON known (skin, own);
CREATE TABLE IF NOT EXISTS skin (hash TEXT PRIMARY KEY, document TEXT);
"""


class Known(NamedTuple):
    """One recording in the index, as it was when it was read."""

    recording: str
    """Name of the recording's file."""
    source: str
    """Size, time and number of that file."""
    own: bool
    """Whether the skin is the recording's own."""
    skin: str
    """Hash of the skin that it is labelled with."""
    made: str
    """Hash of skin, model version, settings and code."""
    hash: str
    """SHA-256 of the recording."""
    job: str
    """The press that it needs, as JSON; "" if nothing is touched."""
    label: str = ""
    """Size, time and number of the label's file when it was found current; "" if it was not."""


class LabelIndex:
    """An SQLite file in the folder of the labels. It may be deleted: then every recording and label is read again.

    A file that changed in content but in neither size, time nor number is not noticed here; `tacdata label --redo`
    reads all, and every reader of a label checks its checksums.
    """

    def __init__(self, folder: Path) -> None:
        """Name the folder of the labels."""
        self.path = folder / "index.sqlite"
        self._db: sqlite3.Connection | None = None

    def open(self) -> bool:
        """Open the cache for `find`; False if it is missing or damaged."""
        self.close()
        if not self.path.exists():
            return False
        try:
            self._db = sqlite3.connect(self.path, check_same_thread=False)
            self._db.execute("SELECT count(*) FROM skin").fetchone()
        except sqlite3.DatabaseError:
            self.close()
            self.path.unlink(missing_ok=True)
            return False
        return True

    def close(self) -> None:
        """Close the connection of `open`."""
        if self._db is not None:
            self._db.close()
        self._db = None

    def skins(self) -> dict[tuple[str, bool], dict[str, Any]]:
        """Return the skins that labels were made with, by hash and whether they are the recordings' own."""
        statement = (
            "SELECT used.skin, used.own, skin.document FROM (SELECT DISTINCT skin, own FROM known) AS used"
            " JOIN skin ON skin.hash = used.skin"
        )
        rows = self._db.execute(statement).fetchall() if self._db else []
        return {(key, bool(from_recording)): json.loads(text) for key, from_recording, text in rows}

    def find(self, recordings: Sequence[str]) -> dict[str, Known]:
        """Return the records of recordings by name, some hundreds at most: a session may have a million."""
        if self._db is None or not recordings:
            return {}
        statement = f"SELECT * FROM known WHERE recording IN ({', '.join('?' * len(recordings))})"
        try:
            return {row[0]: Known(*row) for row in self._db.execute(statement, recordings)}
        except sqlite3.DatabaseError:
            return {}

    def write(self, rows: Iterable[Known], skins: Mapping[str, dict[str, Any]]) -> None:
        """Add rows. A cache that cannot be written is no loss."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with closing(sqlite3.connect(self.path, timeout=5.0)) as db, db:
                # The index can be made again, so it is not worth a sync.
                db.execute("PRAGMA synchronous = OFF")
                for statement in TABLES.split(";"):
                    db.execute(statement)
                texts = ((key, json.dumps(document)) for key, document in skins.items())
                db.executemany("INSERT OR REPLACE INTO skin VALUES (?, ?)", texts)
                db.executemany("INSERT OR REPLACE INTO known VALUES (?, ?, ?, ?, ?, ?, ?, ?)", rows)
        except (OSError, sqlite3.OperationalError):
            return
        except sqlite3.DatabaseError:
            # Any other error than a lock or a full disk means that the file is damaged.
            self.path.unlink(missing_ok=True)


def stamp(path: Path) -> str:
    """Return a file's size, time and number as text; "" without one."""
    try:
        status = path.stat()
    except OSError:
        return ""
    return f"{status.st_size}/{status.st_mtime_ns}/{status.st_ino}"
