"""Where a worker gets jobs and leaves results: this machine's store and ledger, or a service."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from tacdata.errors import UsageError
from tacdata.label_farm.ledger.ledger import Lease, Ledger
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor


class Desk(Protocol):
    """The interface of a desk, local or remote."""

    def offers(self) -> list[str]:
        """Return the model versions with waiting jobs, the most urgent first."""
        ...

    def sensor(self, version: str) -> Sensor:
        """Return the sensor that a model is of."""
        ...

    def claim(self, version: str, count: int) -> list[Lease]:
        """Take up to ``count`` jobs of one model."""
        ...

    def has(self, job: Job) -> bool:
        """Return whether a job's complete result exists already."""
        ...

    def put(self, job: Job, solution: PathSolution) -> None:
        """Leave a result; raises SolveError if it must not become a label."""
        ...

    def finish(self, job: Job, seconds: float) -> None:
        """Mark a job done."""
        ...

    def fail(self, job: Job, failure: Failure, seconds: float = 0.0) -> None:
        """Mark a job failed, with its reason."""
        ...

    def beat(self) -> None:
        """Give a sign of life, by which claims stay valid."""
        ...

    def note(self, text: str) -> None:
        """Store in words why this worker does not work, or does not solve yet."""
        ...

    def leave(self) -> None:
        """Return claimed jobs without counting a try, and leave the roster."""
        ...


class LocalDesk:
    """A desk at the store and ledger of this machine."""

    def __init__(
        self, store: Path, owner: str, lease_seconds: float, versions: list[str] | None = None, device: str = "cpu"
    ) -> None:
        """Open store and ledger.

        Args:
            store: Folder of the store.
            owner: Under which name jobs are claimed.
            lease_seconds: For how long a claim holds without a sign of life [s].
            versions: Model versions to work for; None for all that are offered.
            device: Device of the worker, for the roster.
        """
        self.store, self.owner, self._versions = Store(store), owner, versions
        self.ledger = Ledger(self.store.ledger_path, lease_seconds)
        self._sensors: dict[str, Sensor] = {}
        self._roster = Roster(self.ledger)
        self._device = device

    def enter(self) -> None:
        """Add the worker to the roster."""
        self._roster.enter(self.owner, self._device)

    def offers(self) -> list[str]:
        """Return the model versions with waiting jobs, the most urgent first."""
        # A pool's workers serve its run alone; others serve whoever asks.
        if self._versions is not None:
            return [version for version in self._versions if self.ledger.has_work(version)]
        return self.ledger.offered()

    def sensor(self, version: str) -> Sensor:
        """Return the sensor that a model is of.

        Raises:
            UsageError: If nobody registered the model.
        """
        if version not in self._sensors:
            document = self.ledger.sensor(version)
            if document is None:
                raise UsageError(f"model {version[:12]}… is not registered", "a registered model", "submit again")
            self._sensors[version] = Sensor.from_document(document, "sensor")
        return self._sensors[version]

    def claim(self, version: str, count: int) -> list[Lease]:
        """Take up to ``count`` jobs of one model."""
        return self.ledger.claim(self.owner, version, count)

    def has(self, job: Job) -> bool:
        """Return whether a job's complete result exists already."""
        # A damaged file counts as none, so that its press is solved again.
        return self.store.intact(job)

    def put(self, job: Job, solution: PathSolution) -> None:
        """Leave a result.

        Raises:
            SolveError: If it must not become a label.
        """
        self.store.put(job, solution, self.sensor(job.model))

    def finish(self, job: Job, seconds: float) -> None:
        """Mark a job done."""
        self.ledger.finish(job.key, self.owner, seconds)

    def fail(self, job: Job, failure: Failure, seconds: float = 0.0) -> None:
        """Mark a job failed, with its reason."""
        # The reason before the mark: whoever sees the mark reads the reason.
        self.store.put_failure(job, failure)
        self.ledger.fail(job.key, self.owner, failure.reason, seconds)

    def beat(self) -> None:
        """Give a sign of life, by which claims stay valid."""
        self.ledger.heartbeat(self.owner)

    def note(self, text: str) -> None:
        """Store in words why this worker does not work, or does not solve yet."""
        self._roster.note(self.owner, text)

    def leave(self) -> None:
        """Return claimed jobs without counting a try, and leave the roster."""
        self.ledger.release(self.owner, blame=False)
        self._roster.leave(self.owner)
        self.ledger.close()
