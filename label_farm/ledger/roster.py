"""The workers of a ledger: their counts, and whether they still respond."""

from __future__ import annotations

import time
from dataclasses import dataclass

from tacdata.label_farm.ledger.ledger import Ledger, boot_name, is_dead


@dataclass(frozen=True)
class WorkerRow:
    """One worker: its counts and its last sign of life."""

    owner: str
    """Host and process."""
    device: str
    """Its device, such as "cpu" or "cuda:0"."""
    done: int
    """Presses solved."""
    failed: int
    """Presses given up."""
    busy: float
    """Time spent on them [s]."""
    up: float
    """Time since it began [s]."""
    silent: float
    """Time since its last sign of life [s]."""
    holds: int
    """Presses that it works on."""
    note: str
    """Why it does not work, in words, or ""."""


class Roster:
    """Workers of one ledger."""

    def __init__(self, ledger: Ledger) -> None:
        """Look at a ledger."""
        self._ledger = ledger

    def enter(self, owner: str, device: str) -> None:
        """Add a worker."""
        clock = time.monotonic()
        self._ledger.rows(
            "INSERT OR REPLACE INTO worker (owner, device, began, seen, boot) VALUES (?, ?, ?, ?, ?)",
            (owner, device, clock, clock, boot_name()),
        )

    def count(self, owner: str, done: int, failed: int, busy: float) -> None:
        """Count the jobs of a worker whose jobs another process claims for it; ``busy`` in s."""
        self._ledger.rows(
            "UPDATE worker SET done = done + ?, failed = failed + ?, busy = busy + ?, seen = ? WHERE owner = ?",
            (done, failed, busy, time.monotonic(), owner),
        )

    def note(self, owner: str, text: str) -> None:
        """Store why a worker does not work, or does not solve yet."""
        self._ledger.rows("UPDATE worker SET note = ? WHERE owner = ?", (text, owner))

    def notes(self) -> list[str]:
        """Return the notes of all workers."""
        return [note for [note] in self._ledger.rows("SELECT coalesce(note, '') FROM worker")]

    def leave(self, owner: str) -> None:
        """Remove a worker."""
        self._ledger.rows("DELETE FROM worker WHERE owner = ?", (owner,))

    def listing(self, forget: float = 600.0) -> list[WorkerRow]:
        """Return the workers; remove those that ended, are from before a restart, or gave no sign for long [s]."""
        clock, boot, rows_listed = time.monotonic(), boot_name(), []
        rows = self._ledger.rows(
            "SELECT owner, device, done, failed, busy, began, seen, coalesce(note, ''), boot,"
            " (SELECT count(*) FROM job WHERE state = 1 AND job.owner = worker.owner) FROM worker ORDER BY owner"
        )
        for owner, device, done, failed, busy, began, last_sign, note, its_boot, holds in rows:
            # Clocks of two starts of a machine cannot be compared.
            if its_boot != boot or clock - last_sign > forget or is_dead(owner):
                self.leave(owner)
            else:
                rows_listed.append(
                    WorkerRow(owner, device, done, failed, busy, clock - began, clock - last_sign, holds, note)
                )
        return rows_listed
