"""Routes that receive recordings of another computer, a piece of a file at a time."""

from __future__ import annotations

import os
import re
import shutil
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, Query, Request
from fastapi.concurrency import run_in_threadpool

from tacdata import provenance
from tacdata.errors import DeviceError, FormatError, UsageError
from tacdata.label_farm.service.confined import confined
from tacdata.label_farm.service.foreman import Foreman
from tacdata.recording import session
from tacdata.recording.files import file_names

SPARE = 1 << 30
"""Room that stays free on the disk for labels and results [bytes]."""
MOST = 1 << 38
"""Largest file that is taken [bytes]."""


def add_receiving(api: FastAPI, foreman: Foreman) -> None:
    """Add the route for recordings."""
    busy = threading.Lock()

    @api.post("/api/recordings")
    async def receive(
        request: Request,
        folder: Annotated[str, Query(min_length=1, max_length=1000)],
        name: Annotated[str, Query(max_length=40)],
        size: Annotated[int, Query(ge=1, le=MOST)],
        sha256: Annotated[str, Query(pattern="^[0-9a-f]{64}$")],
        offset: Annotated[int, Query(ge=0, le=MOST)],
    ) -> dict[str, Any]:
        """Take the piece of a file that begins at ``offset``; return the bytes here, and whether it is complete.

        A piece that does not begin where the last one ended is not taken: the response states the next offset.
        """
        body = await request.body()

        def take() -> dict[str, Any]:
            with busy:
                return _take(foreman, _Piece(folder, name, size, sha256, offset, body))

        return await run_in_threadpool(take)


@dataclass(frozen=True)
class _Piece:
    folder: str
    name: str
    size: int
    sha256: str
    offset: int
    body: bytes


def _take(foreman: Foreman, piece: _Piece) -> dict[str, Any]:
    path = _place(foreman, piece)
    if path.exists():
        if path.stat().st_size == piece.size and provenance.file_hash(path) == piece.sha256:
            return {"have": piece.size, "whole": True}
        raise UsageError(
            f"another {piece.name} lies in {piece.folder}",
            "a new folder, or the very session that was sent before",
            "send it under another name with --to",
        )
    # With its hash in the name: pieces of another file of this name never mix with it.
    unfinished = path.with_name(f".{piece.name}.{piece.sha256[:16]}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        have = _append(unfinished, piece)
        if have < piece.size:
            return {"have": have, "whole": False}
        if provenance.file_hash(unfinished) != piece.sha256:
            unfinished.unlink()
            raise FormatError(
                f"what came of {piece.name} has another SHA-256", "the bytes that were announced", "send it again"
            )
        os.link(unfinished, path)  # not a rename: that would replace a file which came meanwhile
        unfinished.unlink()
    except OSError as error:
        raise DeviceError(
            f"the service cannot keep {piece.name}: {error.strerror}",
            "a disk with room that may be written",
            "make room there and send again: what came is kept",
        ) from None
    return {"have": piece.size, "whole": True}


def _place(foreman: Foreman, piece: _Piece) -> Path:
    """Return where a file is to lie.

    Raises:
        UsageError: If that is outside of the root, in the store, or no file of a session.
    """
    folder = confined(foreman.root, piece.folder, "folder")
    store = foreman.store.folder.resolve()
    if folder == foreman.root or folder.is_relative_to(store) or store.is_relative_to(folder):
        raise UsageError(
            f"recordings into {piece.folder!r}",
            "a folder of their own beside the farm's store",
            "name another with --to",
        )
    if piece.name != session.FILE and not re.fullmatch(file_names.EPISODE, piece.name):
        raise UsageError(
            f"a file {piece.name!r}",
            f"{session.FILE} and finished recordings",
            "send a session with `tacdata farm send`",
        )
    return folder / piece.name


def _append(unfinished: Path, piece: _Piece) -> int:
    have = unfinished.stat().st_size if unfinished.exists() else 0
    # Sent twice, or after a lost piece: the answer states where to go on.
    if piece.offset != have or not piece.body:
        return have
    if have + len(piece.body) > piece.size:
        raise UsageError(
            f"{have + len(piece.body)} bytes of {piece.name}", f"{piece.size}, as announced", "send it again"
        )
    if shutil.disk_usage(unfinished.parent).free < piece.size - have + SPARE:
        raise UsageError(
            f"no room for {piece.name} of {piece.size} bytes",
            f"{SPARE >> 30} GiB free beside it",
            "make room on the service's disk and send again: what came is kept",
        )
    with unfinished.open("ab") as stream:
        stream.write(piece.body)
        stream.flush()
        # On the disk before the answer: the sender counts it as kept.
        os.fsync(stream.fileno())
    return have + len(piece.body)
