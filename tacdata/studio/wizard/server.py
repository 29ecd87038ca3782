"""The import wizard's page, served on this computer."""

from contextlib import AbstractContextManager
from importlib.resources import files
from threading import Lock
from typing import Any

from fastapi import APIRouter, FastAPI
from fastapi.responses import FileResponse, HTMLResponse
from pydantic import BaseModel

from tacdata.errors import UsageError
from tacdata.pages import live_page
from tacdata.progress import say
from tacdata.studio.wizard.choices import Choices
from tacdata.studio.wizard.wizard import Wizard
from tacdata.viewers.browse import loopback

PORT = 9099
"""Where the page is offered; another where it is in use."""
SEALED = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:; "
    "connect-src 'self'; form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)
"""Policy of the page: it asks no other address, and no other page frames it."""
HEADERS = {"Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff", "Content-Security-Policy": SEALED}


class WriteRequest(BaseModel):
    """Request of the page to write the mapping."""

    choices: Choices
    file: str
    replace: bool = False


class ImportRequest(BaseModel):
    """Request of the page to import by a mapping that was written."""

    file: str
    session: str


class JudgeRequest(BaseModel):
    """Request of the page for a verdict on the session that it made."""

    session: str


def wizard_server(wizard: Wizard, port: int) -> AbstractContextManager[str]:
    """Serve the page of the wizard. See `loopback.page_server`."""
    return loopback.page_server(lambda token: application(wizard, token), port)


def application(wizard: Wizard, token: str) -> FastAPI:
    """Return the application: the page, its contents, a trial of choices, the mapping, the session."""
    api = FastAPI(openapi_url=None)
    routes = APIRouter(prefix=f"/{token}")
    loopback.guard(api, token, HEADERS)
    pages: dict[str, str] = {}  # session -> page of its verdict
    one_at_a_time = Lock()  # requests run in threads of their own; two must not write one file

    @routes.get("/")
    def page() -> HTMLResponse:
        body = files("tacdata.studio.wizard").joinpath("page.html").read_text(encoding="utf-8")
        return HTMLResponse(live_page(f"{wizard.source.name}: import", body))

    @routes.get("/contents")
    def contents() -> dict[str, Any]:
        return wizard.contents()

    @routes.post("/try")
    def tried(choices: Choices) -> dict[str, Any]:
        with one_at_a_time:
            return wizard.tried(choices)

    @routes.post("/write")
    def write(request: WriteRequest) -> dict[str, Any]:
        with one_at_a_time:
            answer = wizard.written(request.choices, request.file, request.replace)
        if "command" in answer:
            say(f"{answer['file']} is written\nnext: {answer['command']}")
        return answer

    @routes.post("/import")
    def imported(request: ImportRequest) -> dict[str, Any]:
        with one_at_a_time:
            answer = wizard.imported(request.file, request.session)
        say(f"{answer['recordings']} recordings in {request.session}")
        return answer

    @routes.post("/judge")
    def judged(asked: JudgeRequest) -> dict[str, Any]:
        with one_at_a_time:
            answer = wizard.judged(asked.session)
        say(f"{answer['folder']} is written")
        pages[asked.session] = answer["page"]
        return {**answer, "page": f"verdict/{len(pages) - 1}"}

    @routes.get("/verdict/{number}")
    def verdict(number: int) -> FileResponse:
        if not 0 <= number < len(pages):
            raise UsageError(f"no verdict {number}", "a verdict of this page", "open it from the page")
        return FileResponse(list(pages.values())[number], headers={"Content-Security-Policy": SEALED})

    api.include_router(routes)
    return api
