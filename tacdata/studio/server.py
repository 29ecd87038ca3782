"""The page of a lab's folder, served on this computer."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, FastAPI
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse

from tacdata.errors import TacdataError, UsageError
from tacdata.pages import live_page
from tacdata.recording.live import recorder_process
from tacdata.studio.entry import PAGES, LabEntry
from tacdata.studio.inventory import SECTIONS, Inventory
from tacdata.studio.live_values import LiveValues
from tacdata.studio.measured import SECTION as MEASURED
from tacdata.studio.recording_state import recording_state
from tacdata.studio.wizard.server import wizard_server
from tacdata.studio.wizard.wizard import Wizard
from tacdata.viewers.browse import loopback

PORT = 9097
"""Where the page is offered; another where it is in use."""
SEALED = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; form-action 'none'"
"""Policy of every file from the folder: a page in it asks nothing of any address, this one included."""


@contextmanager
def studio_server(inventory: Inventory, port: int) -> Iterator[str]:
    """Serve the page of a lab's folder, and the wizards that it opens. See `loopback.page_server`."""
    with ExitStack() as wizards:
        yield wizards.enter_context(loopback.page_server(lambda token: application(inventory, token, wizards), port))


def application(inventory: Inventory, token: str, wizards: ExitStack) -> FastAPI:
    """Return the application: page, list, files that a browser shows, import wizards.

    Args:
        inventory: The lab's folder.
        token: First part of every path.
        wizards: Holds the servers of wizards that were opened, and the recording that is followed.
    """
    api = FastAPI(openapi_url=None)
    routes = APIRouter(prefix=f"/{token}")
    loopback.guard(api, token, {"Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"})
    opened: dict[str, str] = {}  # measured files -> address of their wizard
    values = wizards.enter_context(closing(LiveValues()))
    one_at_a_time = Lock()  # requests run in threads of their own, the list has one memory

    @routes.get("/")
    def page() -> HTMLResponse:
        body = files("tacdata.studio").joinpath("page.html").read_text(encoding="utf-8")
        return HTMLResponse(live_page(f"{inventory.root.name}: studio", body))

    @routes.get("/list")
    def entries() -> dict[str, Any]:
        with one_at_a_time:
            current = inventory.entries()
        return {"root": str(inventory.root), "sections": SECTIONS, "entries": [_plain(entry) for entry in current]}

    @routes.get("/live/{name:path}")
    def live(name: str) -> dict[str, Any] | None:
        with one_at_a_time:
            current = recording_state(running_session(inventory, name), 1 << 30).current
            with suppress(TacdataError):  # it has ended meanwhile, or has no content yet
                return None if current is None else values.of(current)
        return None

    @routes.post("/stop/{name:path}")
    def stopped(name: str) -> dict[str, str]:
        with one_at_a_time:
            session = running_session(inventory, name)
        recorder_process.stop(session)
        return {"said": "stopping: the motion stops, the tip is lifted"}

    @routes.get("/file/{name:path}")
    def file(name: str) -> FileResponse:
        path = shown_file(inventory.root, name)
        kind = "text/plain; charset=utf-8" if path.suffix == ".md" else None
        return FileResponse(path, media_type=kind, headers={"Content-Security-Policy": SEALED})

    @routes.get("/import/{name:path}")
    def wizard(name: str) -> RedirectResponse:
        with one_at_a_time:
            if name not in opened:
                opened[name] = wizards.enter_context(wizard_server(wizard_of(inventory, name), 0))
        return RedirectResponse(opened[name])

    api.include_router(routes)
    return api


def wizard_of(inventory: Inventory, name: str) -> Wizard:
    """Return the import wizard of measured files in the list.

    Raises:
        UsageError: If the list has no such entry.
    """
    known = [entry.path for entry in inventory.entries() if entry.section == MEASURED]
    if name not in known:
        raise UsageError(f"no measured files {name!r}", ", ".join(known) or "none", "open them from the list")
    source = inventory.root / name
    session = inventory.root / f"{source.stem}-session"
    return Wizard.of(source, inventory.root / f"{source.stem}-mapping.yaml", session)


def running_session(inventory: Inventory, name: str) -> Path:
    """Return the folder of a session that is being recorded.

    Raises:
        UsageError: If no recording of that name runs.
    """
    if not any(entry.running and entry.path == name for entry in inventory.entries()):
        raise UsageError(f"no recording runs in {name!r}", "a session that is being recorded", "take it from the list")
    return inventory.root / name


def shown_file(root: Path, name: str) -> Path:
    """Return a file under the folder that a browser shows.

    Args:
        root: The folder, resolved.
        name: Path from it on.

    Raises:
        UsageError: If it is no such file, or lies elsewhere, links followed.
    """
    path = (root / name).resolve() if "\0" not in name else root
    if not path.is_relative_to(root) or path.suffix not in PAGES or not path.is_file():
        raise UsageError(f"no page {name!r}", f"{', '.join(PAGES)} under {root.name}", "open it from the list")
    return path


def _plain(entry: LabEntry) -> dict[str, Any]:
    pages = [{"name": page, "href": "file/" + quote(page)} for page in entry.pages]
    if entry.section == MEASURED:
        pages.append({"name": "assign columns and import", "href": "import/" + quote(entry.path)})
    return {**asdict(entry), "pages": pages}
