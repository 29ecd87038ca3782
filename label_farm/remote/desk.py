"""A service as a worker's desk: jobs come and results go over HTTP."""

from __future__ import annotations

import os
import time
from dataclasses import asdict
from urllib.error import URLError

from tacdata.errors import DeviceError
from tacdata.label_farm.ledger.ledger import Lease
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.remote.client import Client
from tacdata.label_farm.store import solution_file
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.solution_check import check_solution
from tacdata.label_farm.workers.usage import usage_of
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor

PATIENCE_SECONDS, AGAIN_SECONDS = 600.0, 2.0


class RemoteDesk:
    """Jobs over HTTP. A lost connection ends nothing: leases expire at the service, and jobs are solved again."""

    def __init__(self, client: Client, owner: str, device: str = "cpu") -> None:
        """Name the service and the worker."""
        self._client, self.owner, self._device = client, owner, device
        self._sensors: dict[str, Sensor] = {}
        self._results: dict[str, bytes] = {}

    def _me(self, **more: object) -> dict[str, object]:
        return {"owner": self.owner, "device": self._device, **more}

    def enter(self) -> float:
        """Put the worker on the roster; return how long a claim holds [s]."""
        return float(self._client.post("/api/work/enter", self._me())["lease_seconds"])

    def offers(self) -> list[str]:
        """Return the model versions that there is work for; none while the service cannot be reached."""
        try:
            return self._client.get("/api/work/offers")
        except DeviceError:
            return []

    def sensor(self, version: str) -> Sensor:
        """Return the sensor that a model is of."""
        if version not in self._sensors:
            document = self._client.get(f"/api/work/sensors/{version}")
            self._sensors[version] = Sensor.from_document(document, "the service's sensor")
        return self._sensors[version]

    def claim(self, version: str, count: int) -> list[Lease]:
        """Take up to ``count`` jobs of one model; none while the service cannot be reached."""
        try:
            claims = self._client.post("/api/work/claim", self._me(version=version, count=count))
        except DeviceError:
            return []
        return [Lease(Job.from_document(entry["job"], "the service's job"), entry["tries"]) for entry in claims]

    def has(self, job: Job) -> bool:
        """Return False: the service gives out no job that has a result."""
        return False

    def put(self, job: Job, solution: PathSolution) -> None:
        """Check a result and keep it until `finish` sends it.

        Raises:
            SolveError: If it must not become a label.
        """
        check_solution(job, solution, self.sensor(job.model))
        self._results[job.key] = solution_file.encode(job, solution)

    def finish(self, job: Job, seconds: float) -> None:
        """Send the result, repeatedly for a while if the connection is lost. A late result counts as well."""
        headers = {"Content-Type": "application/octet-stream", "X-Owner": self.owner, "X-Seconds": f"{seconds:.6f}"}
        result, deadline = self._results.pop(job.key), time.monotonic() + PATIENCE_SECONDS
        while True:
            try:
                self._client.send("POST", f"/api/work/results/{job.key}", result, headers)
                return
            except DeviceError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(AGAIN_SECONDS)

    def fail(self, job: Job, failure: Failure, seconds: float = 0.0) -> None:
        """Say why a job has no result."""
        # Cut, as the service limits the size of a request (`service.guard`, `service.work`).
        why = {**asdict(failure), "reason": failure.reason[:10_000], "log": failure.log[-40_000:], "seconds": seconds}
        self._client.post(f"/api/work/failures/{job.key}", self._me(**why))

    def beat(self) -> None:
        """Give a sign of life, by which claims stay valid."""
        try:
            usage = usage_of(os.getpid())
            self._client.post("/api/work/beat", self._me(**(asdict(usage) if usage else {})))
        except DeviceError as error:
            raise URLError(str(error)) from None

    def note(self, text: str) -> None:
        """Say in words why this worker does not work, or does not solve yet."""
        self._client.post("/api/work/beat", self._me(note=text[:2000]))

    def leave(self) -> None:
        """Give claimed jobs back, without blame, and leave."""
        self._client.post("/api/work/leave", self._me())
