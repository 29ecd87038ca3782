"""The labels of one session: current, of another model version, or missing with a reason."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Self

from tacdata import documents
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.labels.make_label import make_label, parents
from tacdata.label_farm.labels.request import LabelRequest, Planned
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import STALE_SECONDS
from tacdata.labels import Label, PathSolution, file_names, read_label, table, write_label

_PULL = 0.01
"""Force that pulls over the largest that pushes, from which on it is no error of the solver [1]."""


class SessionLabels:
    """The folder ``SESSION/labels``: one label file an episode, or the reason why there is none."""

    def __init__(self, folder: Path) -> None:
        """Name the folder; it is made when the first file is written."""
        self.folder = folder
        self._parents: dict[int, dict[str, str] | None] = {}
        self._passed = 0

    @classmethod
    def of(cls, session: Path) -> Self:
        """Return a session's own labels."""
        return cls(file_names.folder(session))

    @property
    def labelled(self) -> list[int]:
        """Episodes that have a label."""
        return [*file_names.present(self.folder)]

    @property
    def failed(self) -> list[int]:
        """Episodes of which it is written why they have no label."""
        return [*file_names.present(self.folder, file_names.FAILURE)]

    def sweep(self) -> None:
        """Remove files of killed writers; a young file may belong to a living one."""
        for path in self.folder.glob(".episode-*"):
            with suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > STALE_SECONDS:
                    path.unlink()

    def path(self, episode: int) -> Path:
        """Return the path of an episode's label."""
        return file_names.label(self.folder, episode)

    def failure_path(self, episode: int) -> Path:
        """Return the path of the reason why an episode has no label."""
        return file_names.failure(self.folder, episode)

    def failures(self, limit: int) -> dict[str, str]:
        """Return the reasons of up to ``limit`` episodes that have no label, by episode number."""
        reasons = {}
        for number, path in islice(file_names.present(self.folder, file_names.FAILURE).items(), limit):
            with suppress(FormatError):
                reasons[str(number)] = Failure.read(path).reason
        return reasons

    def parents(self, episode: int) -> dict[str, str] | None:
        """Return the hashes that the present label was made from; None without a readable label."""
        if episode not in self._parents:
            parents = self._read_parents(self.path(episode))
            # None is not kept: most episodes of a large session have no label yet.
            if parents is None:
                return None
            self._parents[episode] = parents
        return self._parents[episode]

    def forget(self, episode: int) -> None:
        """Forget the parents of a label, as its file changed."""
        self._parents.pop(episode, None)

    def _read_parents(self, path: Path) -> dict[str, str] | None:
        try:
            if not path.exists():
                return None
            label = read_label(path)
            self._passed += passed_through(label)
            return dict(label.provenance["parents"])
        except table.LabelVersionError as error:
            # Not damaged: it must not be replaced unasked.
            return {"model": error.given.rpartition(": ")[2]}
        except FormatError:
            return None

    def refuse_other_models(self, requests: Sequence[Planned]) -> None:
        """Refuse to mix model versions within the folder.

        Raises:
            UsageError: If a label there is of another model version than the request's.
        """
        conflicts = []
        for request in requests:
            parents = self.parents(request.episode)
            if parents is not None and parents.get("model") != request.model:
                conflicts.append((request, str(parents.get("model"))))
        if conflicts:
            request, model = conflicts[0]
            wrong = f"; in {self._passed} the skin passed through the indenter" if self._passed else ""
            raise UsageError(
                f"{self.folder} is a label store from another model version: {len(conflicts)} of "
                f"{len(requests)} labels, first {self.path(request.episode).name}, are of "
                f"{_short(model)}{wrong}",
                f"labels of the current model {request.model[:12]}… (sensor, law, mesh, settings, code)",
                "give --redo to replace them, or use the tacdata release and sensor file that made them",
            )

    def current(self, request: LabelRequest | Planned) -> bool:
        """Return whether the label exists with exactly the parents of this request."""
        return self.parents(request.episode) == parents(request)

    def write(self, request: LabelRequest, solution: PathSolution | None) -> Label:
        """Make and write a label; forget an earlier failure. Return the label."""
        label = make_label(request, solution)
        write_label(self.path(request.episode), label)
        self._parents.pop(request.episode, None)
        self.failure_path(request.episode).unlink(missing_ok=True)
        return label

    def write_failure(self, episode: int, failure: Failure, job: Job | None) -> None:
        """Write why an episode has no label; an older label, no longer current, becomes ``.superseded``."""
        documents.write(self.failure_path(episode), failure.document(job), "label_failure")
        if self.path(episode).exists():
            self.path(episode).replace(self.path(episode).with_suffix(".superseded"))
        self._parents.pop(episode, None)


def passed_through(label: Label) -> bool:
    """Return whether the skin of a label without adhesion pulls at an indenter that it pushed before.

    Older releases took it for an equilibrium when the skin had come out on the far side of a thin shape.
    """
    solver = label.provenance.get("parameters", {}).get("solver") or {}
    if solver.get("parameters", {}).get("adhesion"):
        return False
    lift = label.force[:, 2]
    return bool(lift.max(initial=0.0) > 0 and lift.min(initial=0.0) < -_PULL * lift.max(initial=0.0))


def _short(model: str) -> str:
    """Return the start of a hash; words as they are."""
    return model if " " in model else f"{model[:12]}…"
