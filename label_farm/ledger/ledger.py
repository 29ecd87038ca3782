"""The queue of jobs, in SQLite (WAL): who works on which. It may be lost, as the store holds the results."""

from __future__ import annotations

import json
import os
import socket
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from tacdata.errors import FormatError
from tacdata.label_farm.ledger.file_locks import refuse_without_locks
from tacdata.label_farm.ledger.tables import (
    DROP_UNWANTED,
    FIRST_EXPIRED,
    FIRST_WAITING,
    GIVE_BACK,
    LAYOUT,
    LIVING,
    NEXT,
    OPEN,
    TABLES,
    TAKE,
    UNWANTED,
    WAITING_TOGETHER,
)
from tacdata.label_farm.presses.job import Job

WAITING, LEASED, DONE, FAILED = range(4)
LEASE_SECONDS = 30.0
BUSY_SECONDS = 60.0
MAX_TRIES = 3


@dataclass(frozen=True)
class Lease:
    """A job that a worker holds until its lease ends."""

    job: Job
    tries: int
    """How often the job has been taken up, this time included."""


@dataclass(frozen=True)
class JobOutcome:
    """A job that was solved or failed."""

    number: int
    """Running number of the change in this ledger."""
    key: str
    done: bool
    """True if its result is in the store, False if it failed."""
    error: str
    """Reason if it failed."""
    seconds: float
    """Time that the solve took [s]; 0 if the result was found in the store."""


def owner_name() -> str:
    """Return the name under which this process holds leases: its host and process number."""
    return f"{socket.gethostname()}/{os.getpid()}"


def boot_name() -> str:
    """Return an identifier that changes with a restart of the machine, after which no lease of before can be alive."""
    path = Path("/proc/sys/kernel/random/boot_id")
    return path.read_text().strip() if path.exists() else ""


class Ledger:
    """One connection to a ledger; each process and thread opens its own. Local disks only (WAL).

    Leases are kept on the monotonic clock of the ledger's machine, so that a wall clock that jumps
    neither ends nor prolongs one.
    """

    def __init__(self, path: Path, lease_seconds: float = LEASE_SECONDS) -> None:
        """Open or make a ledger.

        Raises:
            FormatError: If the file is damaged or of another layout; it may be deleted, no result is in it.
            UsageError: If its drive locks no files.
        """
        self.path, self.lease_seconds = path, lease_seconds
        self._boot = boot_name()
        refuse_without_locks(path)
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
        # In WAL mode a power cut then costs the last commits at most, and results are in the store.
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
        # The write lock at once: a transaction that reads first can fail when it comes to write.
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            # SQLite has rolled back by itself where the disk was full.
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def _unusable(self, what: str, allowed: str) -> FormatError:
        return FormatError(
            f"{self.path} {what}", allowed, f"delete {self.path} and its -wal and -shm: no result is lost, run again"
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

    def rows(self, statement: str, values: Iterable[Any] = ()) -> list[tuple]:
        """Run one statement and return its rows: for reads and the roster."""
        return self._db.execute(statement, tuple(values)).fetchall()

    def register(self, sensors: Mapping[str, dict[str, Any]]) -> None:
        """Store the sensor that each model is of.

        Args:
            sensors: Content hash of a model -> document of its sensor.
        """
        rows = ((version, json.dumps(document)) for version, document in sensors.items())
        with self._transaction():
            self._db.executemany("INSERT OR REPLACE INTO model (version, sensor) VALUES (?, ?)", rows)

    def sensor(self, version: str) -> dict[str, Any] | None:
        """Return the document of a model's sensor; None for an unregistered model."""
        row = self._db.execute("SELECT sensor FROM model WHERE version = ?", (version,)).fetchone()
        return json.loads(row[0]) if row else None

    def offered(self) -> list[str]:
        """Return the models with jobs to claim, by the priority of their first job."""
        clock = time.monotonic()
        rows = self._db.execute(
            "SELECT version,"
            " (SELECT rank FROM job WHERE state = 0 AND model = version ORDER BY rank, changed LIMIT 1) AS first,"
            " EXISTS (SELECT 1 FROM job WHERE state = 1 AND model = version AND lease < ?) FROM model",
            (clock,),
        )
        work = [(rank, version) for version, rank, expired in rows if rank is not None or expired]
        return [version for _, version in sorted(work, key=lambda entry: (entry[0] is None, entry[0] or 0))]

    def enqueue(self, jobs: Iterable[Job], priority: int = 0, run: str = "") -> None:
        """Add jobs to the queue; one that is already waiting or worked on stays as it is.

        Args:
            jobs: The jobs. One that counts as done or failed is computed again.
            priority: Larger comes first; raises that of a job already waiting.
            run: Who asks, if the asking is to be taken back some day (`withdraw`).
        """
        listed = list(jobs)
        rows = ((job.key, job.model, json.dumps(job.document), -priority) for job in listed)
        with self._transaction():
            self._db.executemany(
                f"INSERT INTO job (key, model, document, state, rank, changed) VALUES (?, ?, ?, 0, ?, {NEXT})"
                " ON CONFLICT (key) DO UPDATE"
                " SET rank = min(rank, excluded.rank), state = 0, error = NULL, alone = 0,"
                " tries = CASE state WHEN 0 THEN tries ELSE 0 END"
                " WHERE state <> 1",
                rows,
            )
            again = ((-priority, job.key) for job in listed)
            self._db.executemany(f"UPDATE job SET rank = ? WHERE key = ? AND state = 1 AND rank = {UNWANTED}", again)
            if run:
                wishes = ((run, job.key, -priority) for job in listed)
                self._db.executemany("INSERT OR REPLACE INTO wish (run, key, rank) VALUES (?, ?, ?)", wishes)

    def claim(self, owner: str, model: str, count: int = 1) -> list[Lease]:
        """Take up to ``count`` jobs of one model version: by priority, else an expired one.

        No more than a worker's share, so that none is idle while another is full. A job in a batch whose worker died
        is taken alone, which identifies the job that kills.
        """
        clock = time.monotonic()
        with self._transaction():
            self._db.execute(f"{DROP_UNWANTED} AND model = ? AND lease < ?", (model, clock))
            first = self._db.execute(FIRST_WAITING, (model,)).fetchone()
            if first is None:
                keys = [row[0] for row in self._db.execute(FIRST_EXPIRED, (model, clock))]
            elif first[1] or count == 1:
                keys = [first[0]]
            else:
                share = self._share(model, count, clock)
                keys = [row[0] for row in self._db.execute(WAITING_TOGETHER, (model, share))]
            grant = (owner, self._boot, clock + self.lease_seconds)
            rows = [self._db.execute(TAKE, (*grant, key)).fetchone() for key in keys]
        return [_lease(document, tries) for document, tries in rows]

    def _share(self, model: str, count: int, clock: float) -> int:
        """Return how many of a model's open jobs fall to one of the living workers, at most ``count``."""
        living = (self._boot, clock - 2 * self.lease_seconds)
        workers = max(1, self._db.execute(LIVING, living).fetchone()[0])
        unsettled = self._db.execute(OPEN, 2 * (model, count * workers)).fetchone()[0]
        return min(count, -(-unsettled // workers))

    def has_work(self, model: str) -> bool:
        """Return whether `claim` would find a job of a model version."""
        clock = time.monotonic()
        row = self._db.execute(
            "SELECT EXISTS (SELECT 1 FROM job WHERE state = 0 AND model = ?)"
            " OR EXISTS (SELECT 1 FROM job WHERE state = 1 AND model = ? AND lease < ?)",
            (model, model, clock),
        ).fetchone()
        return bool(row[0])

    def heartbeat(self, owner: str) -> None:
        """Renew every lease of a worker."""
        clock = time.monotonic()
        lease = clock + self.lease_seconds
        self._db.execute("UPDATE job SET lease = ? WHERE state = 1 AND owner = ?", (lease, owner))
        self._db.execute("UPDATE worker SET seen = ? WHERE owner = ?", (clock, owner))

    def finish(self, key: str, owner: str, seconds: float) -> bool:
        """Mark a job done; False if the worker's lease was lost meanwhile (its result still counts)."""
        return self._settle(key, owner, DONE, None, seconds)

    def fail(self, key: str, owner: str, error: str, seconds: float = 0.0) -> bool:
        """Mark a job failed with its reason; False if the worker's lease was lost meanwhile."""
        return self._settle(key, owner, FAILED, error, seconds)

    def _settle(self, key: str, owner: str, state: int, error: str | None, seconds: float) -> bool:
        with self._transaction():
            cursor = self._db.execute(
                f"UPDATE job SET state = ?, error = ?, seconds = ?, owner = NULL, changed = {NEXT}"
                " WHERE key = ? AND state = 1 AND owner = ?",
                (state, error, seconds, key, owner),
            )
            if cursor.rowcount == 1:
                self._db.execute(
                    "UPDATE worker SET done = done + ?, failed = failed + ?, busy = busy + ?, seen = ? WHERE owner = ?",
                    (state == DONE, state == FAILED, seconds, time.monotonic(), owner),
                )
        return cursor.rowcount == 1

    def release(self, owner: str, blame: bool) -> list[Lease]:
        """Give a worker's jobs back to the queue.

        Args:
            owner: The worker, which must be dead or stopped.
            blame: Whether the try counts against the job. Several jobs at once share the blame: each is to be tried
                alone, and that alone counts. One with `MAX_TRIES` such tries is not given back.

        Returns:
            The jobs not given back: the caller settles them with `fail`, under the same owner.
        """
        condition = "WHERE state = 1 AND owner = ?"
        with self._transaction():
            count = self._db.execute(f"SELECT count(*) FROM job {condition}", (owner,)).fetchone()[0]
            self._db.execute(f"{DROP_UNWANTED} AND owner = ?", (owner,))
            if not blame:
                self._db.execute(f"{GIVE_BACK}, tries = tries - 1 {condition}", (owner,))
            elif count > 1:
                self._db.execute(f"{GIVE_BACK}, tries = tries - 1, alone = 1 {condition}", (owner,))
            else:
                self._db.execute(f"{GIVE_BACK} {condition} AND tries < ?", (owner, MAX_TRIES))
            rows = self._db.execute(f"SELECT document, tries FROM job {condition}", (owner,)).fetchall()
        return [_lease(*row) for row in rows]

    def release_dead(self) -> None:
        """Give back the leases of dead processes of this machine, and all leases from before a restart."""
        for statement in (DROP_UNWANTED, f"{GIVE_BACK} WHERE state = 1"):
            self._db.execute(f"{statement} AND boot <> ?", (self._boot,))
        for owner in [row[0] for row in self._db.execute("SELECT DISTINCT owner FROM job WHERE state = 1")]:
            if is_dead(owner):
                for statement in (DROP_UNWANTED, f"{GIVE_BACK} WHERE state = 1"):
                    self._db.execute(f"{statement} AND owner = ?", (owner,))

    def last_change(self) -> int:
        """Return the running number of the latest change."""
        return self._db.execute("SELECT coalesce(max(changed), 0) FROM job").fetchone()[0]

    def changes(self, since: int) -> list[JobOutcome]:
        """Return the jobs finished or failed after a change number, in order."""
        rows = self._db.execute(
            "SELECT changed, key, state, coalesce(error, ''), coalesce(seconds, 0.0) FROM job"
            " WHERE changed > ? AND state IN (2, 3) ORDER BY changed",
            (since,),
        )
        return [JobOutcome(number, key, state == DONE, error, seconds) for number, key, state, error, seconds in rows]

    def counts(self) -> dict[int, int]:
        """Return the number of jobs by state (`WAITING`, `LEASED`, `DONE`, `FAILED`)."""
        counts = dict(self._db.execute("SELECT state, count(*) FROM job GROUP BY state").fetchall())
        return {state: counts.get(state, 0) for state in (WAITING, LEASED, DONE, FAILED)}

    def knows(self, key: str) -> bool:
        """Return whether a job was ever asked for."""
        return bool(self._db.execute("SELECT 1 FROM job WHERE key = ?", (key,)).fetchone())

    def held(self, key: str, owner: str) -> Job | None:
        """Return a worker's leased job; None if its lease was lost."""
        row = self._db.execute(
            "SELECT document, tries FROM job WHERE key = ? AND state = 1 AND owner = ?", (key, owner)
        ).fetchone()
        return _lease(*row).job if row else None

    def unsettled(self, limit: int) -> int:
        """Return how many jobs wait or are worked on, counting no further than ``limit``."""
        count = "SELECT count(*) FROM (SELECT 1 FROM job WHERE state = {} LIMIT ?)"
        return sum(self._db.execute(count.format(state), (limit,)).fetchone()[0] for state in (WAITING, LEASED))

    def withdraw(self, run: str) -> int:
        """Withdraw a run's jobs; those of no other run leave the queue.

        One that a worker holds is solved to its end, but not taken up again if that worker gives it back or dies.

        Returns:
            How many jobs left the queue.
        """
        with self._transaction():
            keys = self._db.execute("DELETE FROM wish WHERE run = ? RETURNING key", (run,)).fetchall()
            removed = self._db.executemany(
                "DELETE FROM job WHERE key = ? AND state = 0 AND key NOT IN (SELECT key FROM wish)", keys
            ).rowcount
            self._db.executemany(
                f"UPDATE job SET rank = {UNWANTED} WHERE key = ? AND state = 1 AND key NOT IN (SELECT key FROM wish)",
                keys,
            )
            self._rank(keys)
        return max(removed, 0)

    def prioritize(self, run: str, priority: int) -> None:
        """Change the priority of a run's jobs; a job has the highest priority of its runs."""
        with self._transaction():
            self._db.execute("UPDATE wish SET rank = ? WHERE run = ?", (-priority, run))
            self._rank(self._db.execute("SELECT key FROM wish WHERE run = ?", (run,)).fetchall())

    def _rank(self, keys: list[tuple[str]]) -> None:
        self._db.executemany(
            "UPDATE job SET rank = coalesce((SELECT min(rank) FROM wish WHERE wish.key = job.key), rank)"
            " WHERE key = ? AND state = 0",
            keys,
        )


def _lease(document: str, tries: int) -> Lease:
    return Lease(Job.of_text(document), tries)


def is_dead(owner: str) -> bool:
    """Return whether a worker is a process of this machine that has ended; of other machines nothing is known."""
    host, _, process = owner.partition("#")[0].rpartition("/")
    return host == socket.gethostname() and process.isdigit() and not _alive(int(process))


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
