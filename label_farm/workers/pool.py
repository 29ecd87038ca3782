"""Worker processes on this machine: started, watched, replaced after death, stopped cleanly."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

from tacdata.errors import SolveError, UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.ledger.ledger import LEASE_SECONDS, MAX_TRIES
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.engine import Engine, StoreFull
from tacdata.label_farm.workers.worker import NO_ROOM, OTHER_CODE, Assignment
from tacdata.sensor import Sensor

STOP_SECONDS = 5.0


@dataclass
class _Slot:
    process: subprocess.Popen[str]
    log: Path

    @property
    def owner(self) -> str:
        """The name under which the slot's process holds leases."""
        return f"{socket.gethostname()}/{self.process.pid}"


class Pool(Engine):
    """Local workers on one store."""

    def __init__(
        self,
        store: Store,
        factory: str,
        sensors: dict[str, Sensor] | None,
        workers: int,
        lease_seconds: float = LEASE_SECONDS,
        devices: Sequence[str] = ("cpu",),
    ) -> None:
        """Prepare; nothing is started yet.

        Args:
            store: Where results and the ledger lie.
            factory: Dotted path of the function that builds a model of a sensor.
            sensors: Content hash of a model -> the sensor that it models; None to work for every model that the
                ledger offers.
            workers: Number of processes.
            lease_seconds: How long a silent worker keeps its job [s].
            devices: Devices of the workers, one after the other: "cpu" or GPUs such as "cuda:0".
        """
        super().__init__(store, sensors, lease_seconds)
        self.workers = workers
        self._assignment = Assignment(str(store.folder.resolve()), factory, self._versions, lease_seconds)
        self._devices, self._roster = devices, Roster(self._ledger)
        self._slots: list[_Slot] = []
        self._deaths = 0

    @property
    def processes(self) -> list[int]:
        """Process numbers of the workers that were started and not replaced."""
        return [slot.process.pid for slot in self._slots]

    def tend(self, pending: int, settled: bool = False) -> None:
        """Start workers as far as there are jobs, and replace those that died; as `Engine.tend`."""
        if settled:
            self._deaths = 0
        self._replace_dead()
        # No more than there are jobs, as a worker takes seconds to start.
        while len(self._slots) < min(self.workers, pending):
            self._slots.append(self._start(len(self._slots)))

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
        stopped = list(self._slots)
        self._slots.clear()
        # The ledger may lie on a full disk; the processes are gone by now in any case.
        for slot in stopped:
            self._ledger.release(slot.owner, blame=False)
            self._roster.leave(slot.owner)
            slot.log.unlink(missing_ok=True)

    def _start(self, number: int) -> _Slot:
        logs = self.store.folder / "logs"
        logs.mkdir(exist_ok=True)
        log = logs / f"{socket.gethostname()}-{os.getpid()}-{number}.log"
        device = self._devices[number % len(self._devices)]
        with log.open("w") as stream:
            # A process group of its own: Ctrl-C reaches the pool alone, which stops the workers.
            process = subprocess.Popen(
                environment.python("tacdata.label_farm.workers.worker"),
                env=environment.variables(device),
                process_group=0,
                text=True,
                stdin=subprocess.PIPE,
                stdout=stream,
                stderr=stream,
            )
        slot = _Slot(process, log)
        try:
            _stdin(slot).write(replace(self._assignment, device=device).line())
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
            self._roster.leave(slot.owner)
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
        if code == NO_ROOM:
            self._ledger.release(slot.owner, blame=False)
            raise StoreFull(
                f"a worker cannot write to {self.store.folder}: {_last_line(log)}",
                "a disk with room that may be written",
                "make room and run again: what is finished is kept",
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


def _last_line(log: str) -> str:
    return (log.strip().splitlines() or ["it refuses"])[-1]


def _stdin(slot: _Slot) -> IO[str]:
    if slot.process.stdin is None:
        raise SolveError("a worker without standard input", "a pipe", "report this")
    return slot.process.stdin
