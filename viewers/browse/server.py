"""A page on this machine that lists episodes, shows each in Rerun's web viewer, and flags bad ones."""

from __future__ import annotations

import json
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from threading import Lock, Thread
from typing import Any
from urllib.parse import quote, urlsplit

from tacdata.dataset.flags import read_flags
from tacdata.errors import TacdataError
from viewers.browse.episode_list import UNITS, EpisodeList, with_flags
from viewers.browse.flagging import flag_episode, unflag_episode
from viewers.rerun.window import GRPC_PORT, LOOPBACK, WEB_PORT, free_port, quiet_environment, running

PORT = 9095
"""Where the page is offered; another where it is in use."""
LONGEST = 10_000
"""Bytes of a request that are read."""


@contextmanager
def browse_server(listed: EpisodeList, labels: Path | None, predictions: Path | None) -> Iterator[str]:
    """Serve the page while the context lasts.

    It listens on the loopback only, and only whoever knows its address may read or flag.

    Args:
        listed: What is listed, in this order.
        labels: Folder of labels, as for `viewers.source.scene_at`.
        predictions: Folder of predictions, likewise.

    Yields:
        The address to open.
    """
    web = free_port(WEB_PORT)
    with tempfile.TemporaryDirectory(prefix="tacdata-browse-") as folder, quiet_environment() as environment:
        viewer = ["--serve-web", "--bind", LOOPBACK, "--port", str(free_port(GRPC_PORT)), "--web-viewer-port", str(web)]
        pages = Pages(listed, labels, predictions, Path(folder), f"http://{LOOPBACK}:{web}")
        server = ThreadingHTTPServer((LOOPBACK, free_port(PORT)), _handler(pages))
        server.daemon_threads = True
        pages.address = f"http://{LOOPBACK}:{server.server_port}/{pages.token}"
        with running(viewer, environment):
            thread = Thread(target=server.serve_forever, daemon=True)
            thread.start()
            try:
                yield f"{pages.address}/"
            finally:
                server.shutdown()
                server.server_close()
                thread.join()


class Pages:
    """What is served: the page, the list, an episode's Rerun file, and setting flags."""

    def __init__(
        self, listed: EpisodeList, labels: Path | None, predictions: Path | None, folder: Path, viewer: str
    ) -> None:
        """Keep what is to be served.

        Args:
            listed: The episodes.
            labels: Folder of labels.
            predictions: Folder of predictions.
            folder: Where Rerun files are kept.
            viewer: Address of Rerun's web viewer.
        """
        self.listed, self.viewer, self.token, self.address = listed, viewer, secrets.token_urlsafe(16), ""
        self._labels, self._predictions, self._folder, self._drawing = labels, predictions, folder, Lock()

    def page(self) -> bytes:
        """Return the page."""
        return files("viewers.browse").joinpath("page.html").read_bytes()

    def entries(self) -> bytes:
        """Return the list as JSON, with the flags as they are now."""
        rows = [asdict(entry) for entry in with_flags(self.listed.entries, read_flags(self.listed.root))]
        document = {
            "root": str(self.listed.root), "units": UNITS, "episodes": rows, "remarks": self.listed.remarks,
            "viewer": self.viewer + "/?hide_welcome_screen&url=" + quote(self.address + "/episode/", safe=""),
        }  # fmt: skip
        return json.dumps(document).encode()

    def episode(self, number: int) -> bytes:
        """Return an episode's Rerun file, drawn when it is first asked for. Raises as `viewers.source.scene_at`."""
        from viewers.rerun.backend import RerunBackend
        from viewers.source import scene_at

        self.listed.numbered(number)
        file = self._folder / f"{number}.rrd"
        with self._drawing:
            if not file.is_file():
                RerunBackend(file).draw(scene_at(self.listed.root, self._labels, self._predictions, number))
        return file.read_bytes()

    def flag(self, number: int, reason: str) -> str:
        """Set an episode aside for a reason, or take it back where there is none; return what was done."""
        if reason.strip():
            return f"set aside: {flag_episode(self.listed, number, reason)}"
        return f"taken back: {unflag_episode(self.listed, number)}"


def _handler(pages: Pages) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            parts = self._parts()
            try:
                match parts:
                    case []:
                        self._send(pages.page(), "text/html; charset=utf-8")
                    case ["list"]:
                        self._send(pages.entries(), "application/json")
                    case ["episode", name] if name.removesuffix(".rrd").isdecimal():
                        self._send(pages.episode(int(name.removesuffix(".rrd"))), "application/octet-stream")
                    case _:
                        self._refuse(HTTPStatus.NOT_FOUND, "no such page")
            except TacdataError as error:
                self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))

        def do_POST(self) -> None:
            length = int(self.headers.get("Content-Length") or 0)
            if self._parts() != ["flag"] or not 0 < length <= LONGEST:
                self._refuse(HTTPStatus.NOT_FOUND, "no such page")
                return
            try:
                asked = json.loads(self.rfile.read(length))
                said = pages.flag(int(asked["number"]), str(asked["reason"]))
                self._send(json.dumps({"said": said}).encode(), "application/json")
            except (ValueError, KeyError, TypeError):
                self._refuse(HTTPStatus.BAD_REQUEST, "a number and a reason are wanted")
            except TacdataError as error:
                self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))

        def _parts(self) -> list[str] | None:
            """Return the path behind the token; None for whoever does not know it or comes under another name."""
            host = (self.headers.get("Host") or "").rsplit(":", 1)[0]
            token, *rest = urlsplit(self.path).path.strip("/").split("/")
            known = secrets.compare_digest(token.encode(), pages.token.encode())
            return [part for part in rest if part] if known and host in (LOOPBACK, "localhost") else None

        def _send(self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("Access-Control-Allow-Origin", pages.viewer)
            with suppress(ConnectionError):  # whoever asked went on to the next episode
                self.end_headers()
                self.wfile.write(body)

        def _refuse(self, status: HTTPStatus, words: str) -> None:
            self._send(json.dumps({"error": words}).encode(), "application/json", status)

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing: the terminal belongs to the person."""

    return Handler
