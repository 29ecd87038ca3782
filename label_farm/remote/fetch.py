"""Fetches the labels that a service made of a session to the copy of the session here."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tacdata import documents, provenance
from tacdata.errors import DeviceError, UsageError
from tacdata.label_farm.labels.session_labels import SessionLabels
from tacdata.label_farm.remote.client import Client
from tacdata.labels import Label, read_label
from tacdata.recording.session import read_session
from tacdata.replacement import replacement


@dataclass
class Fetched:
    """Episodes fetched, current and failed."""

    written: list[int] = field(default_factory=list)
    """Episodes whose label was brought."""
    current: list[int] = field(default_factory=list)
    """Episodes whose label lay here already."""
    failed: dict[int, str] = field(default_factory=dict)
    """Episode -> reason why the service has no label of it."""


class Fetch:
    """Fetches one submission's results; started again, it goes on."""

    def __init__(self, client: Client, number: str, session: Path, redo: bool = False) -> None:
        """Look at the session on this computer.

        Args:
            client: The service.
            number: The submission.
            session: Folder of the same recordings here; the labels go into its ``labels``.
            redo: Replace labels that lie here and were made from something else.

        Raises:
            UsageError: If that is no number, or the folder is no session.
            FormatError: If it is damaged.
        """
        self._client, self._path, self._redo = client, client.submission(number), redo
        self._recordings = {int(path.stem[-6:]): path for path in read_session(session).episodes}
        self._labels = SessionLabels.of(session)
        self._labels.sweep()
        self.fetched = Fetched()

    def bring(self) -> None:
        """Fetch finished labels that are not here.

        Raises:
            UsageError: If the service does not know the submission or has no results of it, if a label is of another
                recording than the one here, or if another label is here (without ``redo``).
            FormatError: If the content is no label, or the label of another episode.
            DeviceError: If the service cannot be reached or the disk refuses.
        """
        local = {*self.fetched.written, *self.fetched.current}
        remote = self._client.get(f"{self._path}/results")
        missing = [number for number in remote["labels"] if number not in local]
        for number in missing:
            self._bring(number)
            self.fetched.failed.pop(number, None)
        for number in remote["failures"]:
            if number not in self.fetched.failed:
                self._bring_reason(number)

    def _recording(self, number: int) -> Path:
        if number not in self._recordings:
            raise UsageError(
                f"the service labelled episode {number}, of which there is no recording here",
                "the session that was submitted, or a copy of it",
                "name the right folder, or copy the recordings that are missing",
            )
        return self._recordings[number]

    def _bring(self, number: int) -> None:
        path = self._labels.path(number)
        local = hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""
        content = self._client.content(f"{self._path}/labels/{number}.parquet", local)
        if content is None:
            self.fetched.current.append(number)
            return
        path.parent.mkdir(exist_ok=True)
        # Read before it gets its name: a damaged label never replaces a good one.
        unread = path.with_name(f".{path.name}.fetched")
        try:
            with replacement(unread, settled=False) as stream:
                stream.write(content)
            if self._is_wanted(number, read_label(unread)):
                os.replace(unread, path)
                self._labels.forget(number)
                self._labels.failure_path(number).unlink(missing_ok=True)
                self.fetched.written.append(number)
            else:
                self.fetched.current.append(number)
        except OSError as error:
            raise DeviceError(
                f"cannot write {path}: {error.strerror}",
                "a disk with room that may be written",
                "make room and fetch again: what came is kept",
            ) from None
        finally:
            unread.unlink(missing_ok=True)

    def _is_wanted(self, number: int, label: Label) -> bool:
        """Return whether a received label is to be kept; False if one with the same parents is here."""
        recording = self._recording(number)
        parents = dict(label.provenance["parents"])
        if label.episode != number or parents.get("recording") != provenance.file_hash(recording):
            raise UsageError(
                f"the service's label of episode {number} is of another recording than {recording}",
                "a label of this very file",
                "name the session that was submitted; or submit the one that lies here",
            )
        local = self._labels.parents(number)
        if local == parents:
            return False
        if local is not None and not self._redo:
            raise UsageError(
                f"{self._labels.path(number)} was made from something else than the service's label"
                f" (model {str(local.get('model'))[:12]}…, there {str(parents.get('model'))[:12]}…)",
                "no label there, or the same one",
                "give --redo to replace what lies here",
            )
        return True

    def _bring_reason(self, number: int) -> None:
        document: dict[str, Any] = self._client.get(f"{self._path}/failures/{number}")
        documents.check(document, "label_failure", f"the service's failure of episode {number}")
        self._recording(number)
        self.fetched.failed[number] = document["reason"]
        if not self._labels.path(number).exists():
            documents.write(self._labels.failure_path(number), document, "label_failure")
