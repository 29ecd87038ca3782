"""Solves jobs on a Dask cluster; ledger and store stay here.

Dask is not durable; the ledger and the store are: a task that is lost with its worker, or with the
whole cluster, is a claim that is given back. Dask's own messages are pickled: scheduler and workers belong on a network
whose computers are trusted, or behind its TLS (``tls://``).
"""

from __future__ import annotations

import itertools
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tacdata.errors import DeviceError, SolveError, TacdataError, UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.ledger.ledger import Lease, Ledger, owner_name
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store import solution_file
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.engine import Engine, EngineMaker, StoreFull
from tacdata.label_farm.workers.worker import is_disk
from tacdata.sensor import Sensor

if TYPE_CHECKING:
    from distributed import Client, Future

RESOURCE = "press"
"""Resource of which a worker has one: it solves one batch at a time."""
CONNECT_SECONDS = 10
"""How long a scheduler may take to answer."""
ALONE_SECONDS = 30.0
"""Time without any worker after which this is reported."""
FETCH_SECONDS = 15.0
"""How long a finished result may take to come from its worker, which may have been cut off since."""
LOOK_SECONDS = 1.0
"""How often at most the scheduler is asked who is there."""
_models: dict[str, Any] = {}


def solve_there(factory: str, version: str, sensor: dict[str, Any], documents: list[dict[str, Any]]) -> dict[str, Any]:
    """Solve jobs; this runs on a Dask worker. Returns each result as the store's bytes, or its error."""
    from dataclasses import replace

    from tacdata import provenance
    from tacdata.label_farm.presses.model import batch_size, build, solve_each

    if version not in _models:
        try:
            model = build(factory, Sensor.from_document(sensor, "sensor"))
        except TacdataError as error:  # no fault of the press
            return {"worker": owner_name(), "refused": f"it cannot build the model: {error}"}
        if model.content_hash != version:
            refused = f"its model is {model.content_hash[:12]}… ({provenance.code_version()}), not {version[:12]}…"
            return {"worker": owner_name(), "refused": refused}
        _models[version] = model
    jobs, settled, began = [Job.from_document(d, "job") for d in documents], [], time.monotonic()
    for job, outcome in solve_each(_models[version], jobs):
        seconds, began = time.monotonic() - began, time.monotonic()
        if isinstance(outcome, SolveError):
            settled.append((job.key, b"", str(outcome), seconds))
            continue
        stamp = {"seconds": seconds, "code_version": provenance.code_version(), "worker": owner_name()}
        outcome = replace(outcome, provenance={**stamp, **outcome.provenance})
        settled.append((job.key, solution_file.encode(job, outcome), "", seconds))
    device, likes = os.environ.get(environment.DEVICE, "cpu"), batch_size(_models[version])
    return {"worker": owner_name(), "device": device, "batch": likes, "settled": settled}


@dataclass
class _Task:
    future: Future
    owner: str
    leases: list[Lease]


class DaskPool(Engine):
    """The workers of a Dask cluster on one store of this machine."""

    def __init__(
        self,
        store: Store,
        factory: str,
        sensors: dict[str, Sensor] | None,
        workers: int,
        lease_seconds: float,
        devices: Sequence[str],
        address: str,
    ) -> None:
        """Prepare; arguments as of `pool.Pool`, and the scheduler's address, or "here" to start one on this machine.

        The cluster is reached when the first job waits.
        """
        super().__init__(store, sensors, lease_seconds)
        self.workers, self._address, self._factory = workers, address, factory
        self._roster, self._numbers = Roster(self._ledger), itertools.count()
        self._given: dict[str, list[_Task]] = {}
        """Address of a worker -> its task. One at a time: a dying worker loses results that it has not handed over,
        and a press that does no harm would count as the deadly one."""
        self._refused: dict[str, str] = {}
        """Address of a worker -> why it gets no tasks."""
        self._likes: dict[str, int] = {}
        """Address of a worker -> how many jobs its model likes at a time; one until it has reported it."""
        self._names: dict[str, str] = {}
        """Address of a worker that is there -> its name on the roster."""
        self._seen: set[str] = set()
        self._client: Client | None = None
        self._cluster: Any = None
        self._looked, self._alone_since = 0.0, time.monotonic()
        self._gone = threading.Event()
        self._beating = threading.Thread(target=self._beat, args=(lease_seconds,), daemon=True)
        self._beating.start()

    def tend(self, pending: int, settled: bool = False) -> None:
        """Collect finished jobs and submit more; as `Engine.tend`."""
        if not pending and not any(self._given.values()):
            return
        client = self._connected()
        for address, tasks in list(self._given.items()):
            for task in [task for task in tasks if task.future.status == "finished"]:
                tasks.remove(task)
                try:
                    answer = task.future.result(timeout=FETCH_SECONDS)
                except (TimeoutError, CancelledError):
                    # The result went with its worker. Dask would solve it again there, and wait for ever.
                    task.future.cancel(force=True)
                    self._give_back(task, began=False)
                    self._given.pop(address, None)
                    self._looked = time.monotonic()
                    continue
                self._take_in(answer, task, address)
            for task in [task for task in tasks if task.future.status in ("error", "cancelled", "lost")]:
                self._give_back(task, began=True)
                # It gets no more jobs before the scheduler reports it alive: they would be lost, and blamed.
                self._given.pop(address, None)
                self._looked = time.monotonic()
        if time.monotonic() - self._looked > LOOK_SECONDS:
            self._look(client)
        self._give_out(client)

    def stop(self) -> None:
        """Give the jobs back to the queue; may be called twice."""
        for task in itertools.chain(*self._given.values()):
            with suppress(Exception):  # the scheduler may be gone: then nothing is left to cancel
                task.future.cancel(force=True)
            self._ledger.release(task.owner, blame=False)
        self._given, self._looked = {}, 0.0
        for closing in (self._client, self._cluster):
            if closing is not None:
                closing.close()
        self._client = self._cluster = None

    def close(self) -> None:
        """Stop and close the ledger."""
        self._gone.set()
        self.stop()
        for owner in self._seen:
            self._roster.leave(owner)
        super().close()

    def _connected(self) -> Client:
        if self._client is not None and self._client.status == "running":
            return self._client
        from distributed import Client, LocalCluster

        if self._client is not None:
            self.stop()  # the scheduler went away: its jobs are given back
        try:
            if self._address == "here":
                # The ledger counts deaths and tries again; Dask need not.
                self._cluster = LocalCluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    resources={RESOURCE: 1},
                    host="127.0.0.1",
                    scheduler_kwargs={"allowed_failures": 0},
                    dashboard_address=None,
                )
            self._client = Client(self._cluster or self._address, timeout=CONNECT_SECONDS, set_as_default=False)
            return self._client
        except (OSError, TimeoutError) as error:
            raise DeviceError(
                f"no Dask scheduler answers at {self._address}: {error}",
                "tcp://HOST:PORT of one that runs",
                "start it with `dask scheduler`, and join workers with `tacdata farm worker tcp://HOST:PORT`",
            ) from None

    def _look(self, client: Client) -> None:
        """Update the list of workers, and give back the jobs of those that are gone."""
        self._looked = time.monotonic()
        workers = client.scheduler_info(n_workers=-1)["workers"]
        addresses = {address for address, worker in workers.items() if worker.get("resources", {}).get(RESOURCE)}
        self._refused = {address: why for address, why in self._refused.items() if address in addresses}
        self._names = {address: name for address, name in self._names.items() if address in addresses}
        addresses -= self._refused.keys()
        for address in self._given.keys() - addresses:
            for task in self._given.pop(address):
                task.future.cancel(force=True)
                self._give_back(task, address not in self._refused)
        for address in addresses:
            self._given.setdefault(address, [])
        if addresses:
            self._alone_since = self._looked
        elif self._looked - self._alone_since > ALONE_SECONDS:
            self._alone_since = self._looked
            print(f"no worker has joined {self._address}: `tacdata farm worker {self._address}` does", file=sys.stderr)
        if self._refused and not self._given and self._versions is not None:
            why = next(iter(self._refused.values()))
            raise UsageError(
                f"none of the {len(self._refused)} Dask workers has the model asked for: {why}",
                "workers of the version that asks, with all that it needs",
                "install one version everywhere, then run again",
            )

    def _give_out(self, client: Client) -> None:
        for address, tasks in self._given.items():
            while not tasks:
                owner = f"{owner_name()}#{next(self._numbers)}"
                leases = self._claimed(owner, self._likes.get(address, 1))
                if not leases:
                    return
                todo = [lease for lease in leases if not self._found(lease, owner)]
                if todo:
                    tasks.append(_Task(self._submit(client, address, todo), owner, todo))

    def _claimed(self, owner: str, count: int) -> list[Lease]:
        for version in self._ledger.offered():
            if (self._versions is None or version in self._versions) and (
                leases := self._ledger.claim(owner, version, count)
            ):
                return leases
        return []

    def _found(self, lease: Lease, owner: str) -> bool:
        return self.store.intact(lease.job) and self._ledger.finish(lease.job.key, owner, 0.0)

    def _submit(self, client: Client, address: str, leases: list[Lease]) -> Future:
        version = leases[0].job.model
        documents = [lease.job.document for lease in leases]
        # Not pure: Dask would answer an equal task by the earlier result, and a job may be solved again.
        return client.submit(
            solve_there,
            self._factory,
            version,
            self._ledger.sensor(version),
            documents,
            resources={RESOURCE: 1},
            workers=[address],
            allow_other_workers=False,
            pure=False,
            retries=0,
        )

    def _give_back(self, task: _Task, began: bool) -> None:
        """Give back the unsettled jobs of a task; if it began and its worker died, that counts as a try."""
        from distributed.scheduler import KilledWorker

        error = task.future.exception() if task.future.status == "error" else None
        if error is None or isinstance(error, KilledWorker):
            reason = f"its Dask worker died: {error or 'it left the cluster'}"
        else:
            reason = f"unexpected {type(error).__name__}: {error}"
        for lease in self._ledger.release(task.owner, blame=began):
            self.store.put_failure(lease.job, Failure("crash", reason, tries=lease.tries))
            self._ledger.fail(lease.job.key, task.owner, reason)

    def _take_in(self, answer: dict[str, Any], task: _Task, address: str) -> None:
        worker = self._names[address] = f"dask:{answer['worker']}"
        if "refused" in answer:
            self._ledger.release(task.owner, blame=False)
            self._refused[address] = answer["refused"]
            self._count(worker, "?", 0, 0, 0.0)
            self._roster.note(worker, f"refused: {answer['refused']}")
            self._looked = 0.0
            return
        self._likes[address] = answer["batch"]
        jobs = {lease.job.key: lease for lease in task.leases}
        done = failed = 0
        busy = 0.0
        for key, data, reason, seconds in answer["settled"]:
            reason = reason or self._keep(jobs[key].job, data)
            busy += seconds
            if reason:
                failed += 1
                self.store.put_failure(jobs[key].job, Failure("solve", reason, tries=jobs[key].tries))
                self._ledger.fail(key, task.owner, reason, seconds)
            else:
                done += 1
                self._ledger.finish(key, task.owner, seconds)
        self._count(worker, answer["device"], done, failed, busy)

    def _keep(self, job: Job, data: bytes) -> str:
        """Store a result; return why it must not become a label, or ""."""
        try:
            _, solution = solution_file.decode(data, f"result of {job.key[:12]}")
            self.store.put(job, solution, Sensor.from_document(self._ledger.sensor(job.model) or {}, "sensor"))
        except SolveError as error:
            return str(error)
        except OSError as error:
            if not is_disk(error):
                raise
            raise StoreFull(
                f"{self.store.folder} cannot be written: {error}", "a disk with room", "make room: all else is kept"
            ) from None
        return ""

    def _count(self, worker: str, device: str, done: int, failed: int, busy: float) -> None:
        if worker not in self._seen:
            self._roster.enter(worker, device)
            self._seen.add(worker)
        self._roster.count(worker, done, failed, busy)

    def _beat(self, lease_seconds: float) -> None:
        with Ledger(self.store.ledger_path, lease_seconds) as ledger:
            while not self._gone.wait(lease_seconds / 4):
                with suppress(Exception):  # a full disk or a lock held for long: the next beat may succeed
                    for task in list(itertools.chain(*list(self._given.values()))):
                        ledger.heartbeat(task.owner)
                    for name in list(self._names.values()):
                        ledger.heartbeat(name)


def dask_engine(address: str) -> EngineMaker:
    """Return an engine for a scheduler's address, or "here" for a cluster of this machine's processes.

    Raises:
        UsageError: If the address is none.
        ModuleNotFoundError: If Dask is not installed: at once, not when all is planned.
    """
    import distributed  # noqa: F401

    if address != "here" and not address.startswith(("tcp://", "tls://")):
        raise UsageError(f"the scheduler {address!r}", "tcp://HOST:PORT, tls://HOST:PORT or here", "correct --dask")

    def engine(
        store: Store,
        factory: str,
        sensors: dict[str, Sensor] | None,
        workers: int,
        lease_seconds: float,
        devices: Sequence[str],
    ) -> DaskPool:
        return DaskPool(store, factory, sensors, workers, lease_seconds, devices, address)

    return engine


def join(address: str, processes: int | None, devices: tuple[str, ...]) -> None:
    """Join a scheduler with worker processes of this computer, one a GPU or core, until interrupted."""
    environment.end_on_terminate()
    names = environment.devices(devices)
    count = processes or (environment.cores() if names == ("cpu",) else len(names))
    started = []
    for number in range(count):
        device = names[number % len(names)]
        command = [
            *environment.python("distributed.cli.dask_worker"),
            address,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--resources",
            f"{RESOURCE}=1",
            "--name",
            f"{socket.gethostname()}-{os.getpid()}-{number}",
        ]
        started.append(subprocess.Popen(command, env=environment.variables(device)))
    print(f"{count} workers for {address}; Ctrl-C stops them", flush=True)
    try:
        for process in started:
            process.wait()
    finally:
        for process in started:
            process.terminate()
        for process in started:
            process.wait()
