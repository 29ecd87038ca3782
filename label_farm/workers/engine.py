"""Base class of the engines that run jobs: the shared loop, and the methods that each must add."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol

from tacdata.errors import UsageError
from tacdata.label_farm.ledger.ledger import JobOutcome, Ledger
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.loading import modules_of
from tacdata.sensor import Sensor

POLL_SECONDS = 0.1


class StoreFull(UsageError):
    """The store's disk is full or refuses; finished results are kept, and the jobs are back in the queue."""


class Engine(ABC):
    """Runs the jobs of a ledger. Another engine needs its own `tend` and `stop`, and its own name for an option."""

    def __init__(self, store: Store, sensors: dict[str, Sensor] | None, lease_seconds: float) -> None:
        """Open the ledger of a store.

        Args:
            store: Where results and the ledger lie.
            sensors: Content hash of a model -> the sensor that it models; None to work for every model that the
                ledger offers.
            lease_seconds: How long a silent worker keeps its job [s].
        """
        self.store, self._ledger = store, Ledger(store.ledger_path, lease_seconds)
        self._versions = None if sensors is None else list(sensors)
        if sensors is not None:
            self._ledger.register({version: sensor.document for version, sensor in sensors.items()})

    def run(
        self,
        keys: set[str],
        since: int,
        on_change: Callable[[JobOutcome], None],
        grow: Callable[[], set[str] | None] = lambda: None,
        on_loading: Callable[[int, int], None] = lambda done, total: None,
    ) -> int:
        """Run until every job is solved or failed, by these workers or those of another run.

        Args:
            keys: Keys of the jobs, already in the ledger.
            since: The ledger's last change before the store was asked for results.
            on_change: Called for each of the keys as it is finished or failed.
            grow: Asked several times a second for further keys, in the ledger as well; None ends the asking.
            on_loading: Called with the modules of kernels that a worker has loaded and of all, before its first press.

        Returns:
            Number of the last reported change.

        Raises:
            UsageError: If the workers' code is of another version.
            StoreFull: If the store's disk refuses.
            SolveError: If workers cannot start or keep dying.
            DeviceError: If the workers' cluster cannot be reached.
        """
        pending, settled, growing, roster, reported = set(keys), False, True, Roster(self._ledger), None
        # Claims of processes that have ended would otherwise wait for the end of their leases.
        self._ledger.release_dead()
        try:
            while pending or growing:
                if growing:
                    added = grow()
                    growing = added is not None
                    pending |= added or set()
                self.tend(len(pending), settled)
                time.sleep(POLL_SECONDS)
                if (modules := modules_of(roster.notes())) and modules != reported:
                    reported = modules
                    on_loading(*modules)
                settled = False
                for change in self._ledger.changes(since):
                    since, settled = change.number, True
                    if change.key in pending:
                        pending.remove(change.key)
                        on_change(change)
        finally:
            self.stop()
        return since

    @abstractmethod
    def tend(self, pending: int, settled: bool = False) -> None:
        """Keep workers busy; called several times a second.

        Args:
            pending: How many jobs wait.
            settled: Whether a job was settled since the last call.

        Raises:
            UsageError: If the workers' code is of another version (only where the models were named).
            StoreFull: If the store's disk refuses.
            SolveError: If workers cannot start or keep dying.
            DeviceError: If the workers' cluster cannot be reached.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop the workers and give their jobs back to the queue; may be called twice."""

    def close(self) -> None:
        """Stop and close the ledger."""
        self.stop()
        self._ledger.close()


class EngineMaker(Protocol):
    """Factory of an engine: a class such as `pool.Pool`, or a function with its further arguments."""

    def __call__(
        self,
        store: Store,
        factory: str,
        sensors: dict[str, Sensor] | None,
        workers: int,
        lease_seconds: float,
        devices: Sequence[str],
    ) -> Engine:
        """Prepare; arguments as of `pool.Pool`. Nothing is started before the first `tend`."""
        ...
