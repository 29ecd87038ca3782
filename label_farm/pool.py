"""Worker processes on this machine: started, watched, replaced when they die, stopped cleanly."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from label_farm import environment
from label_farm.failure import Failure
from label_farm.ledger import LEASE_SECONDS, MAX_TRIES, Change, Ledger
from label_farm.store import Store
from label_farm.worker import OTHER_CODE, Assignment
from tacdata.errors import SolveError, UsageError
from tacdata.sensor import Sensor

POLL_SECONDS = 0.1
STOP_SECONDS = 5.0


@dataclass
class _Slot:
    process: subprocess.Popen[str]
    log: Path

    @property
    def owner(self) -> str:
        """The name under which the slot's process holds leases."""
        return f"{socket.gethostname()}/{self.process.pid}"


class Pool:
    """Local workers on one store. Another engine needs the same two calls: `run` and `stop`."""

    def __init__(
        self,
        store: Store,
        factory: str,
        sensors: dict[str, Sensor],
        workers: int,
        lease_seconds: float = LEASE_SECONDS,
    ) -> None:
        """Prepare; nothing is started yet.

        Args:
            store: Where results and the ledger lie.
            factory: Dotted path of what builds a model from a sensor.
            sensors: Content hash of a model -> the sensor that it models.
            workers: Number of processes.
            lease_seconds: How long a silent worker keeps its job [s].
        """
        self.store, self.workers = store, workers
        documents = {version: sensor.document for version, sensor in sensors.items()}
        self._assignment = Assignment(str(store.folder.resolve()), factory, documents, lease_seconds)
        self._slots: list[_Slot] = []
        self._ledger = Ledger(store.ledger_path, lease_seconds)
        self._deaths = 0

    @property
    def processes(self) -> list[int]:
        """Process numbers of the workers that were started and not replaced."""
        return [slot.process.pid for slot in self._slots]

    def run(self, keys: set[str], since: int, on_change: Callable[[Change], None]) -> None:
        """Work until every key is settled, by these workers or by those of another run on the same store.

        Args:
            keys: Keys of the jobs, already in the ledger.
            since: The ledger's last change before the store was asked for results.
            on_change: Called for each of the keys as it is finished or failed.

        Raises:
            UsageError: If the workers' code is of another version.
            SolveError: If workers cannot start or keep dying.
        """
        pending = set(keys)
        self._ledger.release_dead()
        try:
            while pending:
                while len(self._slots) < min(self.workers, len(pending)):
                    self._slots.append(self._start(len(self._slots)))
                time.sleep(POLL_SECONDS)
                for change in self._ledger.changes(since):
                    since, self._deaths = change.number, 0
                    if change.key in pending:
                        pending.remove(change.key)
                        on_change(change)
                self._replace_dead()
        finally:
            self.stop()

    def stop(self) -> None:
        """Stop the workers and give their jobs back to the queue; may be called twice."""
        for slot in self._slots:
            slot.process.terminate()
        deadline = time.monotonic() + STOP_SECONDS
        for slot in self._slots:
            try:
                slot.process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                slot.process.kill()
                slot.process.wait()
            self._close(slot)
            self._ledger.release(slot.owner, blame=False)
            slot.log.unlink(missing_ok=True)
        self._slots.clear()

    def close(self) -> None:
        """Stop and let go of the ledger."""
        self.stop()
        self._ledger.close()

    def _start(self, number: int) -> _Slot:
        logs = self.store.folder / "logs"
        logs.mkdir(exist_ok=True)
        log = logs / f"{socket.gethostname()}-{os.getpid()}-{number}.log"
        with log.open("w") as stream:
            # A process group of its own: Ctrl-C reaches the pool alone, which stops the workers.
            process = subprocess.Popen(
                environment.python("label_farm.worker"),
                env=environment.variables(),
                process_group=0,
                text=True,
                stdin=subprocess.PIPE,
                stdout=stream,
                stderr=stream,
            )
        slot = _Slot(process, log)
        try:
            _stdin(slot).write(self._assignment.line())
            _stdin(slot).flush()
        except BrokenPipeError:
            pass  # it died at once: noticed by the next watch, with its log
        return slot

    def _close(self, slot: _Slot) -> None:
        try:
            _stdin(slot).close()
        except BrokenPipeError:
            pass

    def _replace_dead(self) -> None:
        for number, slot in enumerate(self._slots):
            code = slot.process.poll()
            if code is None:
                continue
            self._close(slot)
            self._bury(slot, code)
            self._slots[number] = self._start(number)

    def _bury(self, slot: _Slot, code: int) -> None:
        log = slot.log.read_text(errors="replace")[-4000:]
        if code == OTHER_CODE:
            self._ledger.release(slot.owner, blame=False)
            raise UsageError(
                f"a worker runs other code: {log.strip()}",
                "workers of the same code version as the run",
                "let everything be of one version, then run again",
            )
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        for lease in self._ledger.release(slot.owner, blame=True):
            reason = f"the worker died of {how} in each of {lease.tries} tries"
            self.store.put_failure(lease.job, Failure("crash", reason, log, lease.tries))
            self._ledger.fail(lease.job.key, slot.owner, reason)
        self._deaths += 1
        # Each worker may hold a press that kills it; more deaths with nothing settled are no press's fault.
        if self._deaths > MAX_TRIES * self.workers + 1:
            raise SolveError(
                f"{self._deaths} workers died in a row, no job settled, the last of {how}:\n{log.strip()}",
                "workers that can start and write to the store",
                "see the log above (memory? disk space?); run again to go on: what is finished is kept",
            )


def _stdin(slot: _Slot) -> IO[str]:
    if slot.process.stdin is None:
        raise SolveError("a worker without standard input", "a pipe", "report this")
    return slot.process.stdin
