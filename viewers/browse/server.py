"""A page on this machine that lists episodes, shows each in Rerun's web viewer, and flags bad ones."""

from __future__ import annotations

import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, FastAPI
from fastapi.responses import FileResponse, HTMLResponse
from pydantic import BaseModel, Field

from tacdata.dataset.flags import read_flags, read_history
from tacdata.dataset.notes import Note, read_notes
from tacdata.pages import live_page
from tacdata.viewers.browse import loopback
from tacdata.viewers.browse.episode_list import UNITS, EpisodeList, with_flags, with_notes
from tacdata.viewers.browse.flagging import flag_episode, unflag_episode
from tacdata.viewers.browse.noting import note_stretch, notes_of, unnote_stretch
from tacdata.viewers.rerun.shield import LOOPBACK, shielded
from tacdata.viewers.rerun.window import GRPC_PORT, WEB_PORT, any_port, free_port, quiet_environment, running

PORT = 9095
"""Where the page is offered; another where it is in use."""
LONGEST = 1000
"""Characters of a reason at most."""


@contextmanager
def browse_server(listed: EpisodeList, labels: Path | None, predictions: Path | None) -> Iterator[str]:
    """Serve the page while the context lasts.

    It listens on the loopback only, and only whoever knows its address may read or flag.

    Args:
        listed: Episodes of the list, in this order.
        labels: Folder of labels, as for `viewers.source.scene_at`.
        predictions: Folder of predictions, likewise.

    Yields:
        The address to open.
    """
    web, grpc = any_port(), free_port(GRPC_PORT)
    viewer = ["--serve-web", "--bind", LOOPBACK, "--port", str(grpc), "--web-viewer-port", str(web)]
    with tempfile.TemporaryDirectory(prefix="tacdata-browse-") as folder, quiet_environment() as environment:
        with running(viewer, environment), shielded(web, free_port(WEB_PORT)) as address:
            pages = Pages(listed, labels, predictions, Path(folder), address)
            with serving(pages, free_port(PORT)):
                yield f"{pages.address}/"


@dataclass(frozen=True)
class Times:
    """Which times of an episode a page may point to."""

    timeline: str
    begin: int
    """Its first reading [ns]."""
    deepest: int
    """Its deepest moment [ns]."""


class Pages:
    """Served content: the page, the list, an episode's Rerun file, and setting flags."""

    def __init__(
        self, listed: EpisodeList, labels: Path | None, predictions: Path | None, folder: Path, viewer: str
    ) -> None:
        """Keep the served content.

        Args:
            listed: The episodes.
            labels: Folder of labels.
            predictions: Folder of predictions.
            folder: Where Rerun files are kept.
            viewer: Address of Rerun's web viewer.
        """
        self.listed, self.viewer, self.token, self.address = listed, viewer, secrets.token_urlsafe(16), ""
        self._labels, self._predictions, self._folder, self._drawing = labels, predictions, folder, Lock()
        self._times: dict[int, Times | None] = {}

    def page(self) -> str:
        """Return the page."""
        return live_page("Episodes", files("tacdata.viewers.browse").joinpath("page.html").read_text())

    def entries(self) -> dict[str, Any]:
        """Return the list, with the flags as they are now."""
        flags = read_flags(self.listed.root)
        by_file = {flag.file: flag for flag in flags.values()}
        marked = with_notes(with_flags(self.listed.entries, flags), read_notes(self.listed.root))
        rows: list[dict[str, Any]] = [asdict(entry) for entry in marked]
        for row in rows:
            if row["flag"] and (flag := flags.get(row["recording"]) or by_file.get(row["file"])):
                # Who and when, so that a second person can ask the first.
                row |= {"flagged_at": flag.flagged_at, "flagged_by": flag.flagged_by}
        return {
            "root": str(self.listed.root),
            "units": UNITS,
            "episodes": rows,
            "remarks": self.listed.remarks,
            "viewer": self.viewer + "/?hide_welcome_screen&url=" + quote(self.address + "/episode/", safe=""),
        }

    def episode(self, number: int) -> tuple[Path, Times | None]:
        """Return an episode's Rerun file and times, drawn when first asked for. Raises as `viewers.source.scene_at`."""
        from tacdata.viewers.rerun.backend import RerunBackend
        from tacdata.viewers.rerun.steering import deepest_moment
        from tacdata.viewers.source import scene_at

        self.listed.numbered(number)
        file = self._folder / f"{number}.rrd"
        # Requests run in threads of their own, and two of them must not draw one file.
        with self._drawing:
            if not file.is_file():
                scene = scene_at(self.listed.root, self._labels, self._predictions, number)
                RerunBackend(file).draw(scene)
                moment = deepest_moment(scene)
                begin = int(scene.taxels.time_ns[0])
                self._times[number] = Times(moment.timeline, begin, moment.ns) if moment else None
            return file, self._times.get(number)

    def flag(self, number: int, reason: str) -> str:
        """Set an episode aside for a reason, or take it back where there is none; return a confirmation."""
        if reason.strip():
            return f"set aside: {flag_episode(self.listed, number, reason)}"
        return f"taken back: {unflag_episode(self.listed, number)}"

    def notes(self, number: int) -> list[Note]:
        """Return the notes on an episode, in the order of time."""
        return notes_of(self.listed, number)

    def note(self, asked: NoteRequest) -> str:
        """Add a note on an interval of an episode; return a confirmation."""
        with self._drawing:
            text = note_stretch(self.listed, asked.number, asked.begin, asked.end, asked.text)
            # Drawn again, with the note, when it is asked for next.
            (self._folder / f"{asked.number}.rrd").unlink(missing_ok=True)
        return f"noted: {text}"

    def unnote(self, number: int, place: int) -> str:
        """Delete an episode's note by its place among them; return a confirmation."""
        with self._drawing:
            text = unnote_stretch(self.listed, number, place)
            (self._folder / f"{number}.rrd").unlink(missing_ok=True)
        return f"taken away: {text}"


class NoteRequest(BaseModel):
    """Request of the page for a note on an interval of an episode."""

    number: int
    begin: float
    end: float
    text: str = Field(max_length=LONGEST)


class FlagRequest(BaseModel):
    """Request of the page to set an episode aside or take it back."""

    number: int
    reason: str = Field(max_length=LONGEST)


def application(pages: Pages) -> FastAPI:
    """Return the application that answers the page's requests under its address."""
    api = FastAPI(openapi_url=None)
    routes = APIRouter(prefix=f"/{pages.token}")
    loopback.guard(api, pages.token, {"Access-Control-Allow-Origin": pages.viewer})

    @routes.get("/")
    def page() -> HTMLResponse:
        return HTMLResponse(pages.page())

    @routes.get("/list")
    def entries() -> dict[str, Any]:
        return pages.entries()

    @routes.get("/history")
    def history() -> list[dict[str, Any]]:
        return [asdict(change) for change in read_history(pages.listed.root)]

    @routes.get("/episode/{number}.rrd")
    def episode(number: int) -> FileResponse:
        file, times = pages.episode(number)
        headers = {"X-Times": f"{times.timeline} {times.begin} {times.deepest}"} if times else {}
        return FileResponse(file, media_type="application/octet-stream", headers=headers)

    @routes.post("/flag")
    def flag(asked: FlagRequest) -> dict[str, str]:
        return {"said": pages.flag(asked.number, asked.reason)}

    @routes.get("/notes/{number}")
    def notes(number: int) -> list[dict[str, Any]]:
        return [asdict(note) for note in pages.notes(number)]

    @routes.post("/note")
    def note(asked: NoteRequest) -> dict[str, str]:
        return {"said": pages.note(asked)}

    @routes.delete("/notes/{number}/{place}")
    def unnote(number: int, place: int) -> dict[str, str]:
        return {"said": pages.unnote(number, place)}

    api.include_router(routes)
    return api


@contextmanager
def serving(pages: Pages, port: int) -> Iterator[None]:
    """Answer requests on a port of the loopback while the context lasts; 0 takes any that is free."""
    with loopback.serving(application(pages), port) as address:
        pages.address = f"{address}/{pages.token}"
        yield
