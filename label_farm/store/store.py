"""The store of solved presses: a job's key names its file, and an intact file means that the job is done."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

from tacdata import documents, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store import solution_file
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.solution_check import check_solution
from tacdata.labels import PathSolution
from tacdata.replacement import replacement
from tacdata.sensor import Sensor

MARK = "store.json"
KIND = "tacdata label store"
WRITING = "writing"
STALE_SECONDS = 3600.0


class Store:
    """A folder of results. Any number of processes may read and write it at once."""

    def __init__(self, folder: Path) -> None:
        """Open a store, or make one where the folder is missing or empty.

        Raises:
            UsageError: If the folder holds something else.
            FormatError: If it is a store of another format version.
        """
        self.folder = folder
        mark = folder / MARK
        if not mark.exists():
            # Whoever makes this store at the same time wrote the mark before anything else: asked for once more.
            if self._holds_something() and not mark.exists():
                raise UsageError(
                    f"{folder} is no label store (no {MARK})",
                    "a label store, an empty folder or a new one",
                    "name another folder with --store",
                )
            self._create(mark)
        documents.read(mark, "label_store")
        self._sweep()

    def _holds_something(self) -> bool:
        """Return whether the folder is missing, or has content that is no part of a store."""
        # Temporary names of the mark: another process may be making this store right now.
        begun = f".{MARK}."
        try:
            return any(p.name != WRITING and not p.name.startswith(begun) for p in self.folder.iterdir())
        except FileNotFoundError:
            return False
        except NotADirectoryError:
            return True

    def _create(self, mark: Path) -> None:
        try:
            (self.folder / WRITING).mkdir(parents=True, exist_ok=True)
            documents.write(mark, {"version": schemas.version("label_store"), "kind": KIND}, "label_store")
        except OSError as error:
            raise UsageError(
                f"cannot make a label store in {self.folder}: {error.strerror}",
                "a folder that can be written",
                "name another folder with --store; if the session may not be written, one for labels with --out",
            ) from None

    @property
    def ledger_path(self) -> Path:
        """Path of this store's queue."""
        return self.folder / "ledger.sqlite"

    def path(self, key: str) -> Path:
        """Return the path of a key's result."""
        return self.folder / key[:2] / f"{key}.npz"

    def failure_path(self, key: str) -> Path:
        """Return the path of a key's failure."""
        return self.folder / key[:2] / f"{key}.failure.json"

    def intact(self, job: Job) -> bool:
        """Return whether the result exists and is whole; a damaged one is put aside, to be made again.

        Raises:
            FormatError: If it was written by another major format version.
        """
        return self.get(job) is not None

    def get(self, job: Job) -> PathSolution | None:
        """Return a job's solution, or None if there is none; a damaged one is put aside as ``KEY.damaged``.

        Raises:
            FormatError: If it was written by another major format version.
        """
        path = self.path(job.key)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        try:
            stored_job, solution = solution_file.decode(data, str(path))
            if stored_job.key == job.key:
                return solution
        except solution_file.SolutionVersionError:
            raise
        except FormatError:
            pass
        path.replace(path.with_suffix(".damaged"))
        return None

    def put(self, job: Job, solution: PathSolution, sensor: Sensor) -> None:
        """Store a solution and forget an earlier failure.

        Raises:
            SolveError: If it is not finite, not the path asked for, or of other shapes than the sensor's.
        """
        check_solution(job, solution, sensor)
        self._write(self.path(job.key), solution_file.encode(job, solution))
        self.failure_path(job.key).unlink(missing_ok=True)

    def put_failure(self, job: Job, failure: Failure) -> None:
        """Store why a job failed."""
        document = failure.document(job)
        documents.check(document, "label_failure", f"failure of {job.key[:12]}")
        self._write(self.failure_path(job.key), (json.dumps(document, indent=1) + "\n").encode())

    def keys(self) -> set[str]:
        """Return the keys of all results that lie here, whole or not; a million take seconds."""
        keys: set[str] = set()
        for entry in os.scandir(self.folder):
            if len(entry.name) == 2 and entry.is_dir():
                keys.update(e.name[:-4] for e in os.scandir(entry.path) if e.name.endswith(".npz"))
        return keys

    def failure(self, key: str) -> Failure | None:
        """Return why a job failed, or None; an unreadable reason counts as none: the job is tried again."""
        path = self.failure_path(key)
        if not path.exists():
            return None
        try:
            return Failure.read(path)
        except FormatError:
            return None

    def forget_failure(self, key: str) -> None:
        """Remove a failure, so that the job is tried again."""
        self.failure_path(key).unlink(missing_ok=True)

    def _write(self, path: Path, data: bytes) -> None:
        writing = self.folder / WRITING
        # No sync to disk: results lost by a power cut are solved again, and waiting took a third of a job's overhead.
        try:
            with replacement(path, writing, settled=False) as stream:
                stream.write(data)
        except FileNotFoundError:
            # Another's sweep took it for old: a clock that jumps ages a file by hours.
            writing.mkdir(exist_ok=True)
            with replacement(path, writing, settled=False) as stream:
                stream.write(data)

    def _sweep(self) -> None:
        """Remove files of killed writers; a young file may belong to a living one."""
        for path in (self.folder / WRITING).glob("*"):
            try:
                if time.time() - path.stat().st_mtime > STALE_SECONDS:
                    path.unlink()
            except FileNotFoundError:
                continue
