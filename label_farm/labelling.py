"""From recordings to labels: plan, solve what is missing, write each label as soon as its path is solved."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from label_farm import environment, model
from label_farm.failure import Failure
from label_farm.job import Job
from label_farm.ladder import Ladder
from label_farm.ledger import LEASE_SECONDS, Change, Ledger
from label_farm.margin import Margin
from label_farm.plan import LabelRequest, request
from label_farm.pool import Pool
from label_farm.session_labels import SessionLabels
from label_farm.store import Store
from tacdata import provenance
from tacdata.errors import FormatError, UsageError
from tacdata.recording.episode import Episode
from tacdata.sensor import Sensor

Progress = Callable[[str, int, int], None]
"""Called with the stage ("read" or "solve"), how much of it is done, and how much there is."""


@dataclass(frozen=True)
class FarmSettings:
    """How a session is labelled."""

    factory: str = model.FACTORY
    """Dotted path of what builds the skin model from a sensor."""
    ladder: Ladder = field(default_factory=Ladder)
    """How the states of a path are spaced."""
    uncertainty: bool = True
    """Whether labels say what the spreads that the sensor file states make of them; costs about as much again."""
    workers: int = field(default_factory=environment.cores)
    """Number of worker processes."""
    redo: bool = False
    """Replace labels of another model version, and try failed presses again."""
    lease_seconds: float = LEASE_SECONDS
    """How long a silent worker keeps its job [s]."""


@dataclass
class Summary:
    """What became of a session."""

    written: list[int] = field(default_factory=list)
    """Episodes whose label was written."""
    current: list[int] = field(default_factory=list)
    """Episodes whose label lay there already."""
    failed: dict[int, str] = field(default_factory=dict)
    """Episode -> reason why it has no label."""
    untouched: int = 0
    """Labels without contact, which need no solve."""
    seconds: list[float] = field(default_factory=list)
    """Time of each path solved in this run [s]."""
    found: int = 0
    """Paths that the store held already."""
    margins: list[Margin] = field(default_factory=list)
    """How well each written label with contact is known."""
    remarks: list[str] = field(default_factory=list)
    """What a user should know of the models, in words."""


class Labelling:
    """One run over one session. Stopped at any point, a second run goes on where it stood."""

    def __init__(
        self,
        folder: Path,
        store: Store,
        settings: FarmSettings | None = None,
        progress: Progress = lambda *_: None,
    ) -> None:
        """Prepare a run.

        Args:
            folder: Where the labels go, ``SESSION/labels``.
            store: Where solved paths lie.
            settings: How to label.
            progress: Told how far it is.
        """
        self.labels, self.store = SessionLabels(folder), store
        self.settings, self.progress = settings or FarmSettings(), progress
        self.summary = Summary()
        self._versions: dict[str, str] = {}
        self._sensors: dict[str, Sensor] = {}
        self._waiting: dict[str, list[LabelRequest]] = defaultdict(list)

    def run(self, recordings: Mapping[int, Callable[[], Episode]], sensor: Sensor | None = None) -> Summary:
        """Label recordings.

        Args:
            recordings: Episode number -> function that reads it; a whole session may not fit in memory.
            sensor: The skin to label with, if not each recording's own.

        Raises:
            UsageError: If labels of another model version lie there (without ``redo``), or a folder cannot be
                written.
            SolveError: If the model cannot be built or the workers keep dying.
        """
        requests, unfit = self._read(recordings, sensor)
        if not self.settings.redo:
            self.labels.refuse_other_models(requests)
        try:
            for number, failure in unfit.items():
                self._fail(number, failure, None)
            with Ledger(self.store.ledger_path, self.settings.lease_seconds) as ledger:
                since = ledger.last_change()
                missing = self._missing(requests)
                ledger.enqueue(missing)
            self._solve(missing, since)
        except (OSError, sqlite3.OperationalError) as error:
            raise UsageError(
                f"{self.labels.folder} or {self.store.folder} cannot be written: {error}",
                "folders with space and permission to write",
                "make room and run again: what is finished is kept",
            ) from error
        return self.summary

    def _read(
        self, recordings: Mapping[int, Callable[[], Episode]], sensor: Sensor | None
    ) -> tuple[list[LabelRequest], dict[int, Failure]]:
        requests, unfit = [], {}
        for done, (number, read) in enumerate(recordings.items()):
            self.progress("read", done, len(recordings))
            try:
                episode = read()
            except (FormatError, UsageError) as error:
                unfit[number] = Failure("recording", str(error))
                continue
            skin = sensor or episode.sensor
            skin = skin if self.settings.uncertainty else replace(skin, uncertainty={})
            version = self._version(skin)
            try:
                requests.append(request(episode, skin, version, self.settings.ladder))
            except FormatError as error:
                unfit[number] = Failure("recording", str(error))
        self.progress("read", len(recordings), len(recordings))
        return requests, unfit

    def _version(self, sensor: Sensor) -> str:
        key = provenance.content_hash([sensor.content_hash, sensor.uncertainty])
        if key not in self._versions:
            found = model.version(self.settings.factory, sensor)
            self._versions[key] = found.content_hash
            self._sensors[found.content_hash] = sensor
            self.summary.remarks += found.remarks
        return self._versions[key]

    def _missing(self, requests: list[LabelRequest]) -> list[Job]:
        """Write what can be written at once; return the jobs whose results are wanted and not present."""
        missing: dict[str, Job] = {}
        for wish in requests:
            if self.labels.current(wish):
                self.summary.current.append(wish.episode)
            elif wish.job is None:
                self.summary.untouched += 1
                self._write(wish)
            elif wish.job.key in missing:
                self._waiting[wish.job.key].append(wish)
            elif (failure := self._known_failure(wish.job)) is not None:
                self._fail(wish.episode, failure, wish.job)
            elif self.store.intact(wish.job):
                self.summary.found += 1
                self._write(wish)
            else:
                missing[wish.job.key] = wish.job
                self._waiting[wish.job.key].append(wish)
        return list(missing.values())

    def _known_failure(self, job: Job) -> Failure | None:
        failure = self.store.failure(job.key)
        # The same model fails the same way; only a crash is worth another try without being asked.
        if failure is not None and (self.settings.redo or failure.kind == "crash"):
            self.store.forget_failure(job.key)
            return None
        return failure

    def _solve(self, jobs: list[Job], since: int) -> None:
        if not jobs:
            return
        total = len(jobs)
        by_key = {job.key: job for job in jobs}
        self.progress("solve", 0, total)
        wanted = {version: self._sensors[version] for version in {job.model for job in jobs}}
        pool = Pool(
            self.store, self.settings.factory, wanted, self.settings.workers, self.settings.lease_seconds
        )

        def settle(change: Change) -> None:
            job = by_key.pop(change.key)
            if change.done and change.seconds > 0:
                self.summary.seconds.append(change.seconds)
            for wish in self._waiting[change.key]:
                if change.done:
                    self._write(wish)
                else:
                    self._fail(
                        wish.episode, self.store.failure(job.key) or Failure("solve", change.error), job
                    )
            self.progress("solve", total - len(by_key), total)

        try:
            pool.run(set(by_key), since, settle)
        finally:
            pool.close()

    def _write(self, wish: LabelRequest) -> None:
        solution = self.store.get(wish.job) if wish.job else None
        if wish.job is not None and solution is None:
            reason = "its result was damaged between being written and being read; run again"
            self._fail(wish.episode, Failure("crash", reason), wish.job)
            return
        try:
            label = self.labels.write(wish, solution)
        except FormatError as error:
            self._fail(wish.episode, Failure("recording", str(error)), wish.job)
            return
        self.summary.written.append(wish.episode)
        if (margin := Margin.of(label)) is not None:
            self.summary.margins.append(margin)

    def _fail(self, episode: int, failure: Failure, job: Job | None) -> None:
        self.labels.write_failure(episode, failure, job)
        self.summary.failed[episode] = failure.reason
