"""One worker: a long-lived process that takes jobs from the ledger and leaves results in the store.

It is started by `pool.py` as ``python -m label_farm.worker``, reads its assignment as one line of JSON from
standard input, and ends when that closes: with whoever started it, however that one ended. It may be killed
at any moment.
"""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import sys
import threading
import time
import traceback
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Self

from label_farm.failure import Failure
from label_farm.job import Job
from label_farm.ledger import MAX_TRIES, Lease, Ledger, owner_name
from label_farm.model import Model, build
from label_farm.store import Store
from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.sensor import Sensor

IDLE_SECONDS = 0.1
OTHER_CODE = 14
"""Exit code of a worker whose model has another version than the one that it was started for."""
BROKEN = 15
"""Exit code after an unexpected error: what the process holds is not trusted any more."""


@dataclass(frozen=True)
class Assignment:
    """What a worker is told when it starts."""

    store: str
    """Folder of the store; its ledger lies in it."""
    factory: str
    """Dotted path of what builds the model."""
    sensors: dict[str, dict]
    """Content hash of a model -> document of its sensor."""
    lease_seconds: float
    """For how long a claim holds without a sign of life [s]."""

    def line(self) -> str:
        """Return the assignment as one line."""
        return json.dumps(asdict(self)) + "\n"

    @classmethod
    def from_line(cls, line: str) -> Self:
        """Rebuild an assignment from `line`."""
        return cls(**json.loads(line))


class OtherCodeError(Exception):
    """The model built here is not of the version asked for."""


class Worker:
    """Takes jobs one by one. Models are built when first needed and kept."""

    def __init__(self, assignment: Assignment) -> None:
        """Open the store and the ledger."""
        self.assignment, self.owner = assignment, owner_name()
        self.store = Store(Path(assignment.store))
        self.ledger = Ledger(self.store.ledger_path, assignment.lease_seconds)
        self.sensors = {
            key: Sensor.from_document(document, "sensor") for key, document in assignment.sensors.items()
        }
        self._models: dict[str, Model] = {}

    def step(self) -> bool:
        """Take one job and settle it; False if there is none."""
        for version in self.sensors:
            if self.ledger.has_work(version):
                # Before a job is claimed: a model that cannot be built here is no fault of the press.
                model = self._model(version)
                for lease in self.ledger.claim(self.owner, version):
                    self._settle(lease, model)
                    return True
        return False

    def _settle(self, lease: Lease, model: Model) -> None:
        job, started = lease.job, time.monotonic()
        if self.store.intact(job):
            self.ledger.finish(job.key, self.owner, 0.0)
            return
        if lease.tries > MAX_TRIES:
            self._fail(lease, Failure("crash", f"its worker went silent {MAX_TRIES} times", tries=MAX_TRIES))
            return
        try:
            self._solve(job, model)
        except SolveError as error:
            self._fail(lease, Failure("solve", str(error), traceback.format_exc(), lease.tries))
        except (OSError, MemoryError):
            raise  # not the press's fault: the pool gives the job back
        except Exception as error:
            reason = f"unexpected {type(error).__name__}: {error}"
            self._fail(lease, Failure("crash", reason, traceback.format_exc(), lease.tries))
            raise
        else:
            self.ledger.finish(job.key, self.owner, time.monotonic() - started)

    def _solve(self, job: Job, model: Model) -> None:
        started = time.monotonic()
        solution = model.solve(job)
        made = {
            "seconds": time.monotonic() - started,
            "code_version": provenance.code_version(),
            "worker": self.owner,
        }
        solution = replace(solution, provenance={**made, **solution.provenance})
        self.store.put(job, solution, self.sensors[job.model])

    def _fail(self, lease: Lease, failure: Failure) -> None:
        self.store.put_failure(lease.job, failure)
        self.ledger.fail(lease.job.key, self.owner, failure.reason)

    def _model(self, version: str) -> Model:
        if version not in self._models:
            model = build(self.assignment.factory, self.sensors[version])
            if model.content_hash != version:
                raise OtherCodeError(
                    f"this worker's model is {model.content_hash[:12]}…, the jobs ask for {version[:12]}…"
                )
            self._models[version] = model
        return self._models[version]


def _beat(ledger_path: Path, lease_seconds: float) -> None:
    with Ledger(ledger_path, lease_seconds) as ledger:
        while True:
            time.sleep(lease_seconds / 4)
            # A full disk or a lock held for long must not end the beating: the next one may succeed.
            with suppress(sqlite3.OperationalError):
                ledger.heartbeat(owner_name())


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(0)


def main() -> int:
    """Work until standard input closes; return the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the pool's business
    assignment = Assignment.from_line(sys.stdin.readline())
    worker = Worker(assignment)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    beat = (worker.store.ledger_path, assignment.lease_seconds)
    threading.Thread(target=_beat, args=beat, daemon=True).start()
    try:
        while True:
            if not worker.step():
                time.sleep(IDLE_SECONDS)
    except OtherCodeError as error:
        print(error, file=sys.stderr)
        return OTHER_CODE
    except Exception:
        traceback.print_exc()
        return BROKEN


if __name__ == "__main__":
    # Not sys.exit: threads that wait on standard input and on the ledger must not hold up the end.
    code = main()
    sys.stderr.flush()
    os._exit(code)
