"""Routes for workers on other computers. Nothing is unpickled: documents and checked arrays."""

from __future__ import annotations

import re
from typing import Any

from fastapi import FastAPI, Request
from fastapi.concurrency import run_in_threadpool
from pydantic import BaseModel, ConfigDict, Field

from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.ledger.ledger import Ledger
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.service.foreman import Foreman
from tacdata.label_farm.store import solution_file
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.workers.usage import Usage
from tacdata.sensor import Sensor

OWNER = r"[A-Za-z0-9_.-]{1,80}/[0-9]{1,10}"
MOST_JOBS = 512


class RemoteWorker(BaseModel):
    """A worker on another computer."""

    model_config = ConfigDict(extra="forbid")
    owner: str = Field(pattern=f"^{OWNER}$")
    device: str = Field("cpu", max_length=40)
    note: str | None = Field(None, max_length=2000)


class ClaimRequest(RemoteWorker):
    """Its request for jobs."""

    version: str = Field(pattern="^[0-9a-f]{64}$")
    count: int = Field(1, ge=1, le=MOST_JOBS)


class SignOfLife(RemoteWorker):
    """Sign of life, with the worker's use of its computer."""

    processor: float | None = Field(None, ge=0, le=1e12)
    memory: int | None = Field(None, ge=0, le=2**60)


class FailedJob(RemoteWorker):
    """Its report of a job that failed."""

    kind: str = Field(pattern="^(solve|crash)$")
    reason: str = Field(min_length=1, max_length=10_000)
    log: str = Field("", max_length=40_000)
    tries: int = Field(1, ge=1, le=1000)
    seconds: float = Field(0.0, ge=0, le=1e9)


def add_work(api: FastAPI, foreman: Foreman) -> None:
    """Add the routes for workers."""

    def opened() -> Ledger:
        return Ledger(foreman.store.ledger_path, foreman.lease_seconds)

    @api.post("/api/work/enter")
    def enter(hands: RemoteWorker) -> dict[str, Any]:
        """Begin; answers how long a claim holds without a sign of life."""
        with opened() as ledger:
            Roster(ledger).enter(remote(hands.owner), hands.device)
        return {"lease_seconds": foreman.lease_seconds}

    @api.get("/api/work/offers")
    def offers() -> list[str]:
        """Model versions that there is work for, the most urgent first."""
        with opened() as ledger:
            return ledger.offered()

    @api.get("/api/work/sensors/{version}")
    def sensor(version: str) -> dict[str, Any]:
        """The sensor that a model is of."""
        with opened() as ledger:
            document = ledger.sensor(version)
        if document is None:
            raise UsageError(f"model {version[:12]!r} is not registered", "a model that was offered", "ask for offers")
        return document

    @api.post("/api/work/claim")
    def claim(asked: ClaimRequest) -> list[dict[str, Any]]:
        """Take up to ``count`` jobs of one model."""
        with opened() as ledger:
            leases = ledger.claim(remote(asked.owner), asked.version, asked.count)
            if leases:
                ledger.heartbeat(remote(asked.owner))
            open_ones = []
            for lease in leases:
                # A job whose result is in the store is settled here, and not handed out.
                if foreman.store.intact(lease.job):
                    ledger.finish(lease.job.key, remote(asked.owner), 0.0)
                else:
                    open_ones.append({"job": lease.job.document, "tries": lease.tries})
        return open_ones

    @api.post("/api/work/results/{key}")
    async def result(key: str, request: Request) -> dict[str, Any]:
        """Leave a solved path: the bytes of the store's own format."""
        body = await request.body()
        owner, seconds = request.headers.get("x-owner", ""), request.headers.get("x-seconds", "0")
        return await run_in_threadpool(_take, foreman, key, body, owner, seconds)

    @api.post("/api/work/failures/{key}")
    def give_up(key: str, why: FailedJob) -> dict[str, Any]:
        """Say why a press has no result."""
        owner = remote(why.owner)
        with opened() as ledger:
            job = ledger.held(key, owner)
            if job is None:
                return {"counted": False}
            foreman.store.put_failure(job, Failure(why.kind, why.reason, why.log, why.tries))
            return {"counted": ledger.fail(key, owner, why.reason, why.seconds)}

    @api.post("/api/work/beat")
    def beat(hands: SignOfLife) -> dict[str, Any]:
        """Give a sign of life, by which claims stay valid; a note says why the worker does not solve, "" ends it."""
        with opened() as ledger:
            ledger.heartbeat(remote(hands.owner))
            if hands.note is not None:
                Roster(ledger).note(remote(hands.owner), hands.note)
        if hands.processor is not None and hands.memory is not None:
            foreman.gauges.tell(remote(hands.owner), Usage(hands.processor, hands.memory))
        return {}

    @api.post("/api/work/leave")
    def leave(hands: RemoteWorker) -> dict[str, Any]:
        """Give claimed jobs back, without blame, and leave."""
        with opened() as ledger:
            ledger.release(remote(hands.owner), blame=False)
            Roster(ledger).leave(remote(hands.owner))
        return {}


def remote(owner: str) -> str:
    """Return a remote worker's name in the ledger, which is never that of a local process."""
    return f"remote:{owner}"


def _take(foreman: Foreman, key: str, body: bytes, owner: str, seconds: str) -> dict[str, Any]:
    if not re.fullmatch(OWNER, owner) or not re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", seconds):
        raise UsageError(f"owner {owner[:80]!r}, {seconds[:20]!r} s", "HOST/NUMBER and a time [s]", "use tacdata")
    job, solution = solution_file.decode(body, f"result from {owner}")
    with Ledger(foreman.store.ledger_path, foreman.lease_seconds) as ledger:
        if job.key != key or not ledger.knows(key):
            raise FormatError(
                f"a result for {job.key[:12]}…", f"one for {key[:12]}…, which was asked for", "ask for a claim first"
            )
        document = ledger.sensor(job.model)
        if document is None:
            raise UsageError(f"model {job.model[:12]}… is not registered", "a model that was offered", "claim first")
        # A result that came late still counts: whoever makes it, it is the same.
        foreman.store.put(job, solution, Sensor.from_document(document, "sensor"))
        return {"counted": ledger.finish(key, remote(owner), float(seconds))}
