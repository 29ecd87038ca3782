"""The queue: an SQLite ledger (WAL) of who works on which job. The store is the truth; this may be lost."""

from __future__ import annotations

import json
import os
import socket
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from label_farm.job import Job
from tacdata.errors import FormatError

WAITING, LEASED, DONE, FAILED = range(4)
LAYOUT = 1
LEASE_SECONDS = 30.0
BUSY_SECONDS = 60.0
MAX_TRIES = 3

TABLES = """
CREATE TABLE IF NOT EXISTS job (
    key TEXT PRIMARY KEY, model TEXT NOT NULL, document TEXT NOT NULL, state INTEGER NOT NULL,
    rank INTEGER NOT NULL, changed INTEGER NOT NULL, owner TEXT, boot TEXT, lease REAL,
    tries INTEGER NOT NULL DEFAULT 0, error TEXT, seconds REAL
);
CREATE INDEX IF NOT EXISTS waiting ON job (model, rank, changed) WHERE state = 0;
CREATE INDEX IF NOT EXISTS leased ON job (model, lease) WHERE state = 1;
CREATE INDEX IF NOT EXISTS owned ON job (owner) WHERE state = 1;
CREATE INDEX IF NOT EXISTS changes ON job (changed);
"""
NEXT = "(SELECT coalesce(max(changed), 0) + 1 FROM job)"
# Two statements, each served by one partial index: "state = 0 OR lease < now" in one scans the whole table.
TAKE = (
    "UPDATE job SET state = 1, owner = ?, boot = ?, lease = ?, tries = tries + 1"
    " WHERE key IN ({}) RETURNING document, tries, rank, changed"
)
TAKE_WAITING = TAKE.format("SELECT key FROM job WHERE state = 0 AND model = ? ORDER BY rank, changed LIMIT ?")
TAKE_EXPIRED = TAKE.format("SELECT key FROM job WHERE state = 1 AND model = ? AND lease < ? LIMIT ?")


@dataclass(frozen=True)
class Lease:
    """A job that a worker holds for a while."""

    job: Job
    tries: int
    """How often the job has been taken up, this time included."""


@dataclass(frozen=True)
class Change:
    """A job that was finished or failed."""

    number: int
    """Running number of the change in this ledger."""
    key: str
    done: bool
    """True if its result lies in the store, False if it failed."""
    error: str
    """Reason if it failed."""
    seconds: float
    """Time that the solve took [s]; 0 if the result was found in the store."""


def owner_name() -> str:
    """Return the name under which this process holds leases: its host and process number."""
    return f"{socket.gethostname()}/{os.getpid()}"


def boot_name() -> str:
    """Return what changes with a restart of the machine, after which no lease of before can be alive."""
    path = Path("/proc/sys/kernel/random/boot_id")
    return path.read_text().strip() if path.exists() else ""


class Ledger:
    """One connection to a ledger; each process and thread opens its own. Local disks only (WAL)."""

    def __init__(self, path: Path, lease_seconds: float = LEASE_SECONDS) -> None:
        """Open or make a ledger.

        Raises:
            FormatError: If the file is damaged or of another layout; it may be deleted, no result is in it.
        """
        self.path, self.lease_seconds = path, lease_seconds
        self._boot = boot_name()
        self._db = sqlite3.connect(path, timeout=BUSY_SECONDS, isolation_level=None)
        try:
            self._prepare()
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError as error:
            raise self._unusable(f"is damaged: {error}", "an SQLite ledger") from None

    def _prepare(self) -> None:
        deadline = time.monotonic() + BUSY_SECONDS
        # SQLite's own waiting does not cover the change to WAL, on which two first openers meet.
        while self._db.execute("PRAGMA journal_mode").fetchone()[0] != "wal":
            try:
                self._db.execute("PRAGMA journal_mode = WAL")
            except sqlite3.OperationalError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        self._db.execute("PRAGMA synchronous = NORMAL")
        if not self._layout():
            with self._transaction():
                if not self._layout():
                    for statement in TABLES.split(";"):
                        self._db.execute(statement)
                    self._db.execute(f"PRAGMA user_version = {LAYOUT}")
        if self._layout() != LAYOUT:
            raise self._unusable(f"has layout {self._layout()}", f"layout {LAYOUT}")

    def _layout(self) -> int:
        return self._db.execute("PRAGMA user_version").fetchone()[0]

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def _unusable(self, what: str, allowed: str) -> FormatError:
        return FormatError(
            f"{self.path} {what}",
            allowed,
            f"delete {self.path} and its -wal and -shm: no result is lost, run again",
        )

    def close(self) -> None:
        """Close the connection."""
        self._db.close()

    def __enter__(self) -> Self:
        """Return the open ledger."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close."""
        self.close()

    def enqueue(self, jobs: Iterable[Job], priority: int = 0) -> None:
        """Ask for jobs whose results are missing; one that is already waiting or worked on stays as it is.

        Args:
            jobs: What to compute. One that the ledger holds for done or failed is computed again.
            priority: Larger comes first; raises that of a job already waiting.
        """
        rows = ((job.key, job.model, json.dumps(job.document), -priority) for job in jobs)
        with self._transaction():
            self._db.executemany(
                f"INSERT INTO job (key, model, document, state, rank, changed) VALUES (?, ?, ?, 0, ?, {NEXT})"
                " ON CONFLICT (key) DO UPDATE"
                " SET rank = min(rank, excluded.rank), state = 0, tries = 0, error = NULL"
                " WHERE state <> 1",
                rows,
            )

    def claim(self, owner: str, model: str, count: int = 1) -> list[Lease]:
        """Take up to ``count`` jobs of one model version: waiting ones by priority, else expired ones."""
        now = time.monotonic()
        grant = (owner, self._boot, now + self.lease_seconds)
        with self._transaction():
            rows = self._db.execute(TAKE_WAITING, (*grant, model, count)).fetchall()
            if not rows:
                rows = self._db.execute(TAKE_EXPIRED, (*grant, model, now, count)).fetchall()
        rows.sort(key=lambda row: row[2:])
        return [_lease(document, tries) for document, tries, *_ in rows]

    def has_work(self, model: str) -> bool:
        """Return whether `claim` would find a job of a model version."""
        now = time.monotonic()
        row = self._db.execute(
            "SELECT EXISTS (SELECT 1 FROM job WHERE state = 0 AND model = ?)"
            " OR EXISTS (SELECT 1 FROM job WHERE state = 1 AND model = ? AND lease < ?)",
            (model, model, now),
        ).fetchone()
        return bool(row[0])

    def heartbeat(self, owner: str) -> None:
        """Renew every lease of a worker."""
        lease = time.monotonic() + self.lease_seconds
        self._db.execute("UPDATE job SET lease = ? WHERE state = 1 AND owner = ?", (lease, owner))

    def finish(self, key: str, owner: str, seconds: float) -> bool:
        """Mark a job done; False if the worker's lease was lost meanwhile (its result still counts)."""
        return self._settle(key, owner, DONE, None, seconds)

    def fail(self, key: str, owner: str, error: str, seconds: float = 0.0) -> bool:
        """Mark a job failed with its reason; False if the worker's lease was lost meanwhile."""
        return self._settle(key, owner, FAILED, error, seconds)

    def _settle(self, key: str, owner: str, state: int, error: str | None, seconds: float) -> bool:
        cursor = self._db.execute(
            f"UPDATE job SET state = ?, error = ?, seconds = ?, owner = NULL, changed = {NEXT}"
            " WHERE key = ? AND state = 1 AND owner = ?",
            (state, error, seconds, key, owner),
        )
        return cursor.rowcount == 1

    def release(self, owner: str, blame: bool) -> list[Lease]:
        """Give a worker's jobs back to the queue.

        Args:
            owner: The worker, which must be dead or stopped.
            blame: Whether the try counts against the job; one with `MAX_TRIES` such tries is not given back.

        Returns:
            The jobs not given back: the caller settles them with `fail`, under the same owner.
        """
        back = "UPDATE job SET state = 0, owner = NULL"
        with self._transaction():
            if blame:
                self._db.execute(f"{back} WHERE state = 1 AND owner = ? AND tries < ?", (owner, MAX_TRIES))
            else:
                self._db.execute(f"{back}, tries = tries - 1 WHERE state = 1 AND owner = ?", (owner,))
            kept = self._db.execute(
                "SELECT document, tries FROM job WHERE state = 1 AND owner = ?", (owner,)
            ).fetchall()
        return [_lease(*row) for row in kept]

    def release_dead(self) -> None:
        """Give back what dead processes of this machine held, and all leases from before a restart."""
        self._db.execute(
            "UPDATE job SET state = 0, owner = NULL WHERE state = 1 AND boot <> ?", (self._boot,)
        )
        owners = [row[0] for row in self._db.execute("SELECT DISTINCT owner FROM job WHERE state = 1")]
        host = socket.gethostname()
        for owner in owners:
            name, _, process = owner.rpartition("/")
            if name == host and not _alive(int(process)):
                self._db.execute(
                    "UPDATE job SET state = 0, owner = NULL WHERE state = 1 AND owner = ?", (owner,)
                )

    def last_change(self) -> int:
        """Return the running number of the latest change."""
        return self._db.execute("SELECT coalesce(max(changed), 0) FROM job").fetchone()[0]

    def changes(self, since: int) -> list[Change]:
        """Return the jobs finished or failed after a change number, in order."""
        rows = self._db.execute(
            "SELECT changed, key, state, coalesce(error, ''), coalesce(seconds, 0.0) FROM job"
            " WHERE changed > ? AND state IN (2, 3) ORDER BY changed",
            (since,),
        )
        return [
            Change(number, key, state == DONE, error, seconds) for number, key, state, error, seconds in rows
        ]

    def counts(self) -> dict[int, int]:
        """Return how many jobs are in each state (`WAITING`, `LEASED`, `DONE`, `FAILED`)."""
        found = dict(self._db.execute("SELECT state, count(*) FROM job GROUP BY state").fetchall())
        return {state: found.get(state, 0) for state in (WAITING, LEASED, DONE, FAILED)}


def _lease(document: str, tries: int) -> Lease:
    return Lease(Job.from_document(json.loads(document), "ledger"), tries)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    # In a container without an init process the dead stay in the table as zombies.
    status = Path(f"/proc/{process}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"
