"""The HTTP interface of the service (OpenAPI under /openapi.json), and its page."""

from __future__ import annotations

from dataclasses import asdict
from importlib.resources import files
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse
from pydantic import BaseModel, ConfigDict, Field

from tacdata import provenance
from tacdata.errors import FormatError, SolveError, TacdataError, UsageError
from tacdata.label_farm.ledger.ledger import Ledger
from tacdata.label_farm.service.foreman import Foreman
from tacdata.label_farm.service.gauges import SHOWN as MINUTES
from tacdata.label_farm.service.guard import Guard
from tacdata.label_farm.service.metrics import add_metrics
from tacdata.label_farm.service.receiving import add_receiving
from tacdata.label_farm.service.results import add_results
from tacdata.label_farm.service.submission import Submission
from tacdata.label_farm.service.work import add_work
from tacdata.pages import HtmlPage, PageHeader, Paragraph, Table, live_page

SHOWN = 20
"""Of how many submissions, the newest, labels and failures are shown."""
STATUS = {UsageError: 400, FormatError: 422, SolveError: 422}
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; img-src blob:"


class SubmissionRequest(BaseModel):
    """A request of a person; as `schemas/submission.schema.json`."""

    model_config = ConfigDict(extra="forbid")
    session: str = Field(min_length=1, max_length=1000)
    by: str = Field(min_length=1, max_length=100)
    priority: int = Field(0, ge=-1000, le=1000)
    sensor: str | None = Field(None, max_length=1000)
    dataset: str | None = Field(None, max_length=1000)
    redo: bool = False
    uncertainty: bool = True
    tolerance: float = Field(0.005, ge=0, le=10)
    load_step: float = Field(0.25, gt=0, le=10)
    unload_step: float = Field(0.75, gt=0, le=10)


class PriorityRequest(BaseModel):
    """A new priority."""

    model_config = ConfigDict(extra="forbid")
    priority: int = Field(ge=-1000, le=1000)


def application(foreman: Foreman, token: str = "") -> Guard:
    """Return the ASGI application.

    Args:
        foreman: Who works the submissions off.
        token: Token of every request; empty for the loopback alone.
    """
    api = FastAPI(title="tacdata label farm", version=provenance.code_version(), docs_url=None, redoc_url=None)

    @api.exception_handler(TacdataError)
    async def _in_words(_: Request, error: TacdataError) -> JSONResponse:
        content = {"given": error.given, "allowed": error.allowed, "next": error.remedy}
        return JSONResponse(content, next((code for kind, code in STATUS.items() if isinstance(error, kind)), 500))

    @api.exception_handler(RequestValidationError)
    async def _unfit(_: Request, error: RequestValidationError) -> JSONResponse:
        # Without the input: it may be no valid JSON (NaN, half of a surrogate pair), which no response can contain.
        first = error.errors()[0]
        where = "/".join(str(part) for part in first["loc"][1:]) or "the request"
        content = {
            "given": f"{where}: {first['msg']}",
            "allowed": "what /openapi.json says of it",
            "next": "correct it",
        }
        return JSONResponse(content, 422)

    @api.get("/", response_class=HTMLResponse, include_in_schema=False)
    def page() -> HTMLResponse:
        body = (files("tacdata.label_farm.service") / "page.html").read_text()
        return _answered(live_page("tacdata label farm", body))

    @api.get("/docs", response_class=HTMLResponse, include_in_schema=False)
    def docs() -> HTMLResponse:
        return _answered(_requests(api))

    _add_submissions(api, foreman)
    add_receiving(api, foreman)
    add_results(api, foreman)
    add_work(api, foreman)
    add_metrics(api, lambda: _farm(foreman), lambda: [submission.state for submission, _ in foreman.states()])
    return Guard(api, token)


def _answered(page: str) -> HTMLResponse:
    return HTMLResponse(page, headers={"Content-Security-Policy": POLICY, "X-Frame-Options": "DENY"})


def _requests(api: FastAPI) -> str:
    """Return the page of the interface: every request with its meaning."""
    rows = [
        (method.upper(), path, request.get("description") or request["summary"])
        for path, methods in api.openapi()["paths"].items()
        for method, request in methods.items()
    ]
    page = HtmlPage(PageHeader("Label farm", "Requests that programs can send to this service.", version=api.version))
    page.add(
        "Requests", Table(("method", "path", "answer"), rows), Paragraph("Their fields: `/openapi.json`.", note=True)
    )
    return page.text


def _add_submissions(api: FastAPI, foreman: Foreman) -> None:
    @api.get("/api/state")
    def state() -> dict[str, Any]:
        """Everything that the page shows."""
        return {"submissions": _listing(foreman), **_farm(foreman)}

    @api.get("/api/throughput")
    def throughput() -> list[dict[str, Any]]:
        """Presses settled a minute since the service began, for one day."""
        return foreman.gauges.throughput()

    @api.post("/api/submissions", status_code=201)
    def submit(wish: SubmissionRequest) -> dict[str, Any]:
        """Ask for a session's labels."""
        return foreman.submit(Submission(**wish.model_dump())).document

    @api.get("/api/submissions/{number}")
    def one(number: str) -> dict[str, Any]:
        """The present state of a submission."""
        foreman.submissions.get(number)
        entry = next(entry for entry in _listing(foreman) if entry["id"] == number)
        entry["recent"], entry["failures"] = foreman.finished(number)
        return entry

    @api.post("/api/submissions/{number}/cancel")
    def cancel(number: str) -> dict[str, Any]:
        """Take a submission back; finished labels stay."""
        return foreman.cancel(number).document

    @api.post("/api/submissions/{number}/priority")
    def prioritize(number: str, asked: PriorityRequest) -> dict[str, Any]:
        """Change a submission's priority."""
        return foreman.prioritize(number, asked.priority).document


def _listing(foreman: Foreman) -> list[dict[str, Any]]:
    listed = []
    for submission, run in foreman.states():
        entry: dict[str, Any] = submission.document
        if run is not None:
            stage, done, total = run.stage
            entry |= {
                "stage": {"name": stage, "done": done, "total": total},
                "presses_left": run.labelling.pending if run.labelling else 0,
            }
        listed.append(entry)
    for entry in listed[-SHOWN:]:
        entry["recent"], entry["failures"] = foreman.finished(entry["id"])
    return listed


def _farm(foreman: Foreman) -> dict[str, Any]:
    with Ledger(foreman.store.ledger_path) as ledger:
        waiting, leased, done, failed = ledger.counts().values()
    workers = [asdict(row) for row in foreman.workers()]
    for row in workers:
        row["rate"] = (row["done"] + row["failed"]) / row["busy"] if row["busy"] > 0 else 0.0
        row |= foreman.gauges.usage(row["owner"])
    rate = sum(row["rate"] for row in workers if not row["note"])
    remaining = waiting + leased
    return {
        "presses": {"waiting": waiting, "in_work": leased, "solved": done, "failed": failed},
        "workers": workers,
        "rate": rate,
        "throughput": foreman.gauges.throughput(MINUTES),
        "seconds_left": remaining / rate if rate and remaining else (0.0 if not remaining else None),
        "paused": foreman.paused,
        "damaged": foreman.submissions.damaged,
        "code_version": provenance.code_version(),
    }
