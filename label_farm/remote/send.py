"""Sends a session to a service that cannot see its folder."""

from __future__ import annotations

import json
import urllib.parse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tacdata import provenance
from tacdata.errors import DeviceError, FormatError
from tacdata.label_farm.remote.client import Client
from tacdata.recording import session

PIECE = 8 << 20
"""Bytes that are sent at a time."""


@dataclass
class Sent:
    """Counts of a transfer."""

    files: int = 0
    """Files that were sent."""
    size: int = 0
    """Their pieces together [bytes]."""
    there: int = 0
    """Files that lay there already, whole."""


def send(client: Client, folder: Path, name: str, progress: Callable[[int, int], None] = lambda *_: None) -> Sent:
    """Send a session's finished recordings; stopped and started again, it goes on within the file.

    Args:
        client: The service.
        folder: The session here.
        name: Where it is to lie there, from the service's root on.
        progress: Called with how many files are there, and how many there will be.

    Raises:
        UsageError: If the folder is no session, or the service refuses it, in its words.
        FormatError: If the session is damaged, or a file did not arrive as it was.
        DeviceError: If the service cannot be reached or a file cannot be read.
    """
    # The session's document comes last: before it, the folder there is no session and cannot be submitted.
    files = [*session.read_session(folder).episodes, folder / session.FILE]
    sent = Sent()
    for done, path in enumerate(files):
        progress(done, len(files))
        try:
            size = _send_file(client, path, name)
        except OSError as error:
            raise DeviceError(f"cannot read {path}: {error.strerror}", "a readable file", "check its disk") from None
        sent.files += size > 0
        sent.there += size == 0
        sent.size += size
    progress(len(files), len(files))
    return sent


def _send_file(client: Client, path: Path, name: str) -> int:
    """Send the missing part of a file; return its number of bytes."""
    size = path.stat().st_size
    request: dict[str, object] = {"folder": name, "name": path.name, "size": size, "sha256": provenance.file_hash(path)}
    # An empty piece asks how much of the file the service has already.
    answer = _piece(client, request, 0, b"")
    sent = 0
    with path.open("rb") as stream:
        while not answer["whole"]:
            stream.seek(answer["have"])
            body = stream.read(PIECE)
            if not body:
                raise FormatError(f"{path} became shorter while it was sent", "a finished recording", "send it again")
            answer = _piece(client, request, answer["have"], body)
            sent += len(body)
    return sent


def _piece(client: Client, request: dict[str, object], offset: int, body: bytes) -> dict:
    query = urllib.parse.urlencode({**request, "offset": offset})
    headers = {"Content-Type": "application/octet-stream"}
    return json.loads(client.send("POST", f"/api/recordings?{query}", body, headers))
