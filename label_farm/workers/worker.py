"""A worker process: takes jobs from a desk, solves them, leaves the results there.

`pool.py` starts it as ``python -m label_farm.workers.worker``. It reads its assignment as one line of JSON from
standard input,
and ends when that closes: with whoever started it, however that one ended. It may be killed at any moment.
"""

from __future__ import annotations

import errno
import json
import os
import signal
import sqlite3
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Self

from tacdata import provenance
from tacdata.errors import DeviceError, SolveError, TacdataError
from tacdata.label_farm.ledger.ledger import MAX_TRIES, Lease, owner_name
from tacdata.label_farm.presses.model import Model, batch_size, build, solve_each
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.workers.desk import Desk, LocalDesk
from tacdata.label_farm.workers.loading import Loading
from tacdata.labels import PathSolution

IDLE_SECONDS = 0.1
FIRST_ALONE = 16
"""Largest batch before which one press goes alone [1]: that of a CPU. The two presses of the shipped recording cost
it 26.5 s one by one and 26.0 s together. A GPU takes as long for one as for all."""
OTHER_CODE = 14
"""Exit code of a worker whose model has another version than the one that it was started for."""
BROKEN = 15
"""Exit code after an unexpected error: the state of the process is not trusted any more."""
NO_ROOM = 16
"""Exit code when the disk is full or refuses: no press is to blame, and no other worker would do better."""


@dataclass(frozen=True)
class Assignment:
    """The arguments of a worker, sent to its process as one line."""

    store: str
    """Folder of the store, which contains its ledger."""
    factory: str
    """Dotted path of the function that builds the model."""
    versions: list[str] | None
    """Model versions to work for; None for all that the ledger offers, passing over those of other code."""
    lease_seconds: float
    """For how long a claim holds without a sign of life [s]."""
    device: str = "cpu"
    """Its device."""

    def line(self) -> str:
        """Return the assignment as one line."""
        return json.dumps(asdict(self)) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Self:
        """Rebuild an assignment from `line`."""
        return cls(**json.loads(line))

    def desk(self) -> LocalDesk:
        """Open the desk."""
        return LocalDesk(Path(self.store), owner_name(), self.lease_seconds, self.versions, self.device)


class OtherCodeError(Exception):
    """The model built here is not of the version asked for."""


class Worker:
    """Takes jobs, a batch at a time. Models are built when first needed and kept."""

    def __init__(self, desk: Desk, factory: str, strict: bool = True) -> None:
        """Sit down at a desk.

        Args:
            desk: Where jobs come from.
            factory: Dotted path of the function that builds a model of a sensor.
            strict: Whether a model that cannot be had here ends the worker; else it is noted and passed over.
        """
        self.desk, self._factory, self._strict = desk, factory, strict
        self._models: dict[str, Model] = {}
        self._refused: dict[str, str] = {}
        self._begun: set[str] = set()
        self._loading = Loading(lambda words: self.desk.note(words))

    def step(self) -> bool:
        """Take one batch of jobs and settle it; False without jobs."""
        with self._loading.listening():
            return self._step()

    def _step(self) -> bool:
        for version in self.desk.offers():
            # Before a job is claimed: a model that cannot be built here is no fault of the press.
            model = self._model(version)
            if model is not None and (leases := self.desk.claim(version, self._count(version, model))):
                self._settle(leases, model)
                self._begun.add(version)
                return True
        return False

    def _count(self, version: str, model: Model) -> int:
        """Return how many jobs to take: the first goes alone, so that there is a label early."""
        count = batch_size(model)
        return 1 if version not in self._begun and count <= FIRST_ALONE else count

    def _settle(self, leases: list[Lease], model: Model) -> None:
        todo = {lease.job.key: lease for lease in leases if self._is_open(lease)}
        began = time.monotonic()
        try:
            for job, outcome in solve_each(model, [lease.job for lease in todo.values()]):
                seconds, began = time.monotonic() - began, time.monotonic()
                self._loading.end()
                self._leave(todo.pop(job.key), outcome, seconds)
            if todo:
                raise RuntimeError(f"the model left {len(todo)} jobs unanswered")
        except (OSError, MemoryError, DeviceError, sqlite3.OperationalError):
            raise  # not the press's fault: the pool gives the jobs back
        except Exception as error:
            # Of several, nobody knows which one did it: each gets a try alone.
            if len(todo) == 1:
                [lease] = todo.values()
                reason = f"unexpected {type(error).__name__}: {error}"
                self.desk.fail(lease.job, Failure("crash", reason, traceback.format_exc(), lease.tries))
            raise

    def _is_open(self, lease: Lease) -> bool:
        if self.desk.has(lease.job):
            self.desk.finish(lease.job, 0.0)
            return False
        if lease.tries > MAX_TRIES:
            reason = f"its worker went silent {MAX_TRIES} times"
            self.desk.fail(lease.job, Failure("crash", reason, tries=MAX_TRIES))
            return False
        return True

    def _leave(self, lease: Lease, outcome: PathSolution | SolveError, seconds: float) -> None:
        try:
            if isinstance(outcome, SolveError):
                raise outcome
            stamp = {"seconds": seconds, "code_version": provenance.code_version(), "worker": owner_name()}
            self.desk.put(lease.job, replace(outcome, provenance={**stamp, **outcome.provenance}))
        except SolveError as error:
            log = "".join(traceback.format_exception(error))
            self.desk.fail(lease.job, Failure("solve", str(error), log, lease.tries), seconds)
        else:
            self.desk.finish(lease.job, seconds)

    def _model(self, version: str) -> Model | None:
        if version in self._refused:
            return None
        if version not in self._models:
            try:
                self._models[version] = self._built(version)
            except (OtherCodeError, TacdataError) as error:
                if self._strict or isinstance(error, DeviceError):
                    raise
                self._refused[version] = str(error)
                self.desk.note(f"refuses model {version[:12]}…: {error}")
                return None
        return self._models[version]

    def _built(self, version: str) -> Model:
        model = build(self._factory, self.desk.sensor(version))
        self._loading.begin()
        if model.content_hash != version:
            raise OtherCodeError(
                f"this worker's model is {model.content_hash[:12]}… ({provenance.code_version()}), "
                f"the jobs ask for {version[:12]}…"
            )
        return model


def beat(desk_of: Callable[[], Desk], lease_seconds: float) -> None:
    """Renew leases for ever, over a desk of this thread's own."""
    desk = desk_of()
    while True:
        time.sleep(lease_seconds / 4)
        # A full disk, a lock held for long or a cut line must not end the beating: the next one may succeed.
        with suppress(sqlite3.OperationalError, OSError):
            desk.beat()


def work(worker: Worker, stopped: Callable[[], bool] = lambda: False) -> int:
    """Take jobs until stopped; return the exit code."""
    try:
        while not stopped():
            if not worker.step():
                time.sleep(IDLE_SECONDS)
    except OtherCodeError as error:
        print(error, file=sys.stderr)
        return OTHER_CODE
    except (OSError, sqlite3.OperationalError) as error:
        traceback.print_exc()
        return NO_ROOM if is_disk(error) else BROKEN
    except DeviceError:
        raise  # the line to a service is cut: whoever started it tries again
    except Exception:
        traceback.print_exc()
        return BROKEN
    return 0


def is_disk(error: Exception) -> bool:
    """Return whether an error is the disk's: full or read-only."""
    numbers = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EACCES)
    return getattr(error, "errno", None) in numbers or any(
        words in str(error) for words in ("disk is full", "disk I/O error", "readonly database")
    )


def _end_with_parent() -> None:
    sys.stdin.read()
    # Not sys.exit, which would end this thread alone.
    os._exit(0)


def main() -> int:
    """Work until standard input closes; return the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the pool's business
    assignment = Assignment.from_line(sys.stdin.readline())
    desk = assignment.desk()
    desk.enter()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threading.Thread(target=beat, args=(assignment.desk, assignment.lease_seconds), daemon=True).start()
    return work(Worker(desk, assignment.factory, strict=assignment.versions is not None))


if __name__ == "__main__":
    # Not sys.exit: threads that wait on standard input and on the ledger must not hold up the end.
    code = main()
    sys.stderr.flush()
    os._exit(code)
