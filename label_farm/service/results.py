"""Routes that hand out a submission's labels, their pictures, and failures."""

from __future__ import annotations

import hashlib
from typing import Any

from fastapi import FastAPI, Request, Response

from tacdata import documents
from tacdata.errors import UsageError
from tacdata.label_farm.labels.session_labels import SessionLabels
from tacdata.label_farm.service.foreman import Foreman
from tacdata.recording.files import file_names


def add_results(api: FastAPI, foreman: Foreman) -> None:
    """Add the routes for results."""

    @api.get("/api/submissions/{number}/results")
    def results(number: str) -> dict[str, list[int]]:
        """Episodes whose label can be fetched, and those of which it is known why they have none."""
        labels, failures = foreman.results(number)
        return {"labels": labels, "failures": failures}

    @api.get("/api/submissions/{number}/labels/{episode}.parquet")
    def label(number: str, episode: int, request: Request) -> Response:
        """A finished label as a file; with its SHA-256 in If-None-Match, only whether it is still that one."""
        path = _labels(foreman, number).path(episode)
        if not foreman.is_labelled(number, episode) or not path.exists():
            raise UsageError(
                f"no finished label of episode {episode} in submission {number}",
                "one that results lists",
                "see `tacdata farm status`",
            )
        content = path.read_bytes()
        mark = f'"{hashlib.sha256(content).hexdigest()}"'
        if request.headers.get("if-none-match") == mark:
            return Response(status_code=304, headers={"ETag": mark})
        return Response(content, media_type="application/vnd.apache.parquet", headers={"ETag": mark})

    @api.get("/api/submissions/{number}/labels/{episode}.png")
    def preview(number: str, episode: int) -> Response:
        """The deepest frame of a finished label as a picture; the header X-Depth has its depth [mm]."""
        from tacdata.label_farm.service.preview import picture

        content, depth = picture(_labels(foreman, number).path(episode))
        return Response(content, media_type="image/png", headers={"X-Depth": f"{depth:.4f}"})

    @api.get("/api/submissions/{number}/labels/{episode}/log")
    def log(number: str, episode: int) -> dict[str, str]:
        """Author, method and error of a finished label, one line each."""
        from tacdata.label_farm.service.preview import account

        return {"log": account(_labels(foreman, number).path(episode))}

    @api.get("/api/submissions/{number}/failures/{episode}.png")
    def failed(number: str, episode: int) -> Response:
        """A press that has no label as a picture: place, depth over time, reason."""
        from tacdata.label_farm.service.failed_press import failed_press

        labels = _labels(foreman, number)
        reason = documents.read(labels.failure_path(episode), "label_failure")["reason"]
        recording = file_names.episode(foreman.session(number), episode)
        return Response(failed_press(recording, reason), media_type="image/png")

    @api.get("/api/submissions/{number}/failures/{episode}")
    def failure(number: str, episode: int) -> dict[str, Any]:
        """Why an episode has no label, with the worker's log (`schemas/label_failure.schema.json`)."""
        return documents.read(_labels(foreman, number).failure_path(episode), "label_failure")


def _labels(foreman: Foreman, number: str) -> SessionLabels:
    return SessionLabels.of(foreman.session(number))
