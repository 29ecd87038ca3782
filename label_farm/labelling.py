"""One run over one session: plan, solve missing presses, write each label as soon as its press is solved."""

from __future__ import annotations

import json
import sqlite3
import time
import uuid
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from tacdata import provenance
from tacdata.errors import FormatError, UsageError
from tacdata.label_farm.growing_session import GrowingSession
from tacdata.label_farm.labels import make_label
from tacdata.label_farm.labels.label_index import Known, stamp
from tacdata.label_farm.labels.margin import Margin
from tacdata.label_farm.labels.recall import FLUSH, Recall, skin_key
from tacdata.label_farm.labels.request import LabelRequest, Planned, request
from tacdata.label_farm.labels.session_labels import SessionLabels
from tacdata.label_farm.ledger.ledger import JobOutcome, Ledger, owner_name
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.summary import LabellingSummary
from tacdata.label_farm.workers.engine import POLL_SECONDS, StoreFull
from tacdata.recording.episode import Episode
from tacdata.recording.files.reader import read_episode
from tacdata.sensor import Sensor

Progress = Callable[[str, int, int], None]
"""Called with the stage ("read", "look", "compile" or "solve"), how much of it is done, and how much there is."""

Delivered = Callable[[int, str], None]
"""Called with an episode's number and "" once its label is written, or the reason why it has none."""

KEPT_REQUESTS = 256
"""Requests kept in memory with their frames; others are read again when their press is solved."""

MANY = 5000
"""Episodes from which on the store is listed whole, rather than asked for each."""


class Labelling:
    """One run over one session. A second run goes on where a stopped one ended.

    `run` does all of it. A service calls `plan` once and `settle` for every change, concurrently with other runs.
    """

    def __init__(
        self,
        folder: Path,
        store: Store,
        settings: FarmSettings | None = None,
        progress: Progress = lambda *_: None,
        delivered: Delivered = lambda *_: None,
        name: str = "",
        versions: dict[str, model.Version] | None = None,
    ) -> None:
        """Prepare a run.

        Args:
            folder: Where the labels go, ``SESSION/labels``.
            store: Where solved paths lie.
            settings: How to label.
            progress: Receives the progress.
            delivered: Called with each episode's number once its label is written, or with the reason why it has none.
            name: Under which the run asks for jobs; by default one of its own.
            versions: Versions of models that were found already, by sensor; a service shares them among its runs.
        """
        self.labels, self.store = SessionLabels(folder), store
        self.settings, self.progress = settings or FarmSettings(), progress
        self.summary = LabellingSummary()
        self.name = name or f"{owner_name()} {uuid.uuid4().hex[:8]}"
        self._delivered = delivered
        self._versions: dict[str, model.Version] = {} if versions is None else versions
        self._made_by: dict[str, str] = {}
        self._skin_keys: dict[str, str] = {}
        self._skins: list[Sensor] = []
        self._keys: dict[int, tuple[Sensor, str]] = {}
        self.sensors: dict[str, Sensor] = {}
        self._waiting: dict[str, list[Planned]] = defaultdict(list)
        self._read_already: dict[int, LabelRequest] = {}
        self._recordings: Mapping[int, Callable[[], Episode]] = {}
        self._paths: Mapping[int, Path] = {}
        self._jobs: dict[str, Job] = {}
        self._total = 0
        self._recall = Recall(folder)

    @property
    def pending(self) -> int:
        """Number of presses that are not settled."""
        return len(self._jobs)

    def run(
        self,
        recordings: Mapping[int, Callable[[], Episode]],
        sensor: Sensor | None = None,
        paths: Mapping[int, Path] | None = None,
        later: GrowingSession | None = None,
    ) -> LabellingSummary:
        """Label recordings.

        Args:
            recordings: Episode number -> function that reads it; a whole session may not fit in memory.
            sensor: The skin to label with, if not each recording's own.
            paths: Episode number -> its recording's file, by which a second run knows it without reading it.
            later: Gives further recordings while they are made.

        Raises:
            UsageError: If labels of another model version lie there (without ``redo``), or a folder cannot be
                written.
            SolveError: If the model cannot be built or the workers keep dying.
        """
        try:
            since = self.plan(recordings, sensor, paths)
            self._solve(since, sensor, later)
        except StoreFull:
            raise
        except (OSError, sqlite3.OperationalError) as error:
            raise UsageError(
                f"{self.labels.folder} or {self.store.folder} cannot be written: {error}",
                "folders with space and permission to write",
                "make room and run again: what is finished is kept",
            ) from error
        finally:
            self.close()
        return self.summary

    def plan(
        self,
        recordings: Mapping[int, Callable[[], Episode]],
        sensor: Sensor | None = None,
        paths: Mapping[int, Path] | None = None,
    ) -> int:
        """Write the labels that need no solving and request missing presses; arguments as of `run`.

        Returns:
            The ledger's last change before the store was asked for results.
        """
        self.labels.sweep()
        requests, unfit = self._read(recordings, sensor, paths or {})
        if not self.settings.redo:
            self.labels.refuse_other_models(requests)
        for number, failure in unfit.items():
            self._fail(number, failure, None)
        with Ledger(self.store.ledger_path, self.settings.lease_seconds) as ledger:
            since = ledger.last_change()
            added = self._missing(requests)
            self._jobs |= added
            self._total += len(added)
            ledger.register({job.model: self.sensors[job.model].document for job in self._jobs.values()})
            ledger.enqueue(added.values(), self.settings.priority, self.name)
        if added:
            self.progress("solve", self._total - len(self._jobs), self._total)
        return since

    def settle(self, change: JobOutcome) -> None:
        """Write the labels of a press that was solved or failed; presses of other runs are ignored."""
        job = self._jobs.get(change.key)
        if job is None:
            return
        wishes = self._waiting[change.key]
        if change.done and not all(self._write(wish) for wish in wishes):
            with Ledger(self.store.ledger_path, self.settings.lease_seconds) as ledger:
                ledger.enqueue([job], self.settings.priority, self.name)
            return
        if change.done and change.seconds > 0:
            self.summary.seconds.append(change.seconds)
        if not change.done:
            failure = self.store.failure(job.key) or Failure("solve", change.error)
            for wish in wishes:
                self._fail(wish.episode, failure, job)
        del self._jobs[change.key], self._waiting[change.key]
        self.progress("solve", self._total - len(self._jobs), self._total)

    def close(self) -> None:
        """Withdraw open jobs and save which labels are current."""
        with suppress(sqlite3.OperationalError, FormatError):
            with Ledger(self.store.ledger_path, self.settings.lease_seconds) as ledger:
                ledger.withdraw(self.name)
        self._recall.close()

    def _read(
        self, recordings: Mapping[int, Callable[[], Episode]], sensor: Sensor | None, paths: Mapping[int, Path]
    ) -> tuple[list[Planned], dict[int, Failure]]:
        wishes, unfit = [], {}
        self._given, first = self._skin(sensor) if sensor else None, not self._recordings
        self._recordings, self._paths = {**self._recordings, **recordings}, {**self._paths, **paths}
        if first and not self.settings.redo:
            self._recall.open(self._given, lambda skin: self._made(skin, self._version(skin)))
        numbers = list(recordings)
        for done, number in enumerate(numbers):
            self.progress("read", done, len(numbers))
            if done % FLUSH == 0:
                self._recall.prefetch([paths[n] for n in numbers[done : done + FLUSH] if n in paths])
            recalled = self._known(number)
            if isinstance(recalled, Planned):
                wishes.append(recalled)
            if recalled:
                continue
            try:
                wishes.append(Planned.of(self._request(number)))
            except FormatError as error:
                unfit[number] = Failure("recording", str(error))
        self._recall.flush()
        self.progress("read", len(recordings), len(recordings))
        return wishes, unfit

    def _known(self, number: int) -> Planned | bool:
        """Return the record of an episode from the last run; True if its label is current, False without a record."""
        path = self._paths.get(number)
        recalled = self._recall.find(path) if path else None
        if path is None or recalled is None:
            return False
        row, skin = recalled
        if row.label and row.label == stamp(self.labels.path(number)):
            self.summary.current.append(number)
            self._delivered(number, "")
            return True
        job = Job.of_text(row.job) if row.job else None
        return Planned(number, row.hash, skin, self._version(skin), job)

    def _request(self, number: int) -> LabelRequest:
        """Read a recording and plan its presses.

        Raises:
            FormatError: If it cannot be read, or is no press.
        """
        path = self._paths.get(number)
        source = stamp(path) if path else ""  # before it is read: a change meanwhile must not go unnoticed
        try:
            episode = self._recordings[number]()
        except UsageError as error:
            raise FormatError(error.given, error.allowed, error.remedy) from None
        except OSError as error:
            raise FormatError(
                f"the recording of episode {number} cannot be read: {error}", "a readable file", "check its disk"
            ) from None
        skin = self._given or self._skin(episode.sensor)
        version = self._version(skin)
        wish = request(episode, skin, version, self.settings.ladder)
        if path is not None:
            job = json.dumps(wish.job.document) if wish.job else ""
            parents = self._made(skin, version)
            if version not in self._skin_keys:
                self._skin_keys[version] = skin_key(skin)
            from_recording = self._given is None
            row = Known(path.name, source, from_recording, self._skin_keys[version], parents, wish.recording, job)
            self._recall.note(row, skin)
        if len(self._read_already) < KEPT_REQUESTS:
            self._read_already[number] = wish
        return wish

    def _skin(self, sensor: Sensor) -> Sensor:
        """Return the skin to label with: one object for all recordings of equal ones, so that it is hashed once."""
        skin = sensor if self.settings.uncertainty else replace(sensor, uncertainty={})
        for known in self._skins:
            if known == skin:
                return known
        self._skins.append(skin)
        return skin

    def _made(self, skin: Sensor, version: str) -> str:
        """Hash of everything that decides a label, apart from its recording."""
        key = version + (skin.transduction.content_hash if skin.transduction else "")
        if key not in self._made_by:
            parts = [skin.document, version, asdict(self.settings.ladder), make_label.code_hash()]
            self._made_by[key] = provenance.content_hash(parts)
        return self._made_by[key]

    def _version(self, sensor: Sensor) -> str:
        # By identity first: a session of a million recordings asks a million times for the same skin's.
        key_of = self._keys.get(id(sensor))
        if key_of is None:
            key = provenance.content_hash([sensor.content_hash, sensor.uncertainty])
            key_of = self._keys[id(sensor)] = (sensor, key)  # kept, so that no other gets its identity
        key = key_of[1]
        if key not in self._versions:
            self._versions[key] = model.version(self.settings.factory, sensor)
        version = self._versions[key]
        if version.content_hash not in self.sensors:
            self.sensors[version.content_hash] = sensor
            self.summary.remarks += version.remarks
        return version.content_hash

    def _missing(self, wishes: list[Planned]) -> dict[str, Job]:
        """Write the labels that need no solving; return the jobs without a result, by key."""
        missing: dict[str, Job] = {}
        stored = self.store.keys() if len(wishes) > MANY else None
        for done, wish in enumerate(wishes):
            self.progress("look", done, len(wishes))
            job = wish.job
            if self.labels.current(wish):
                self._found_current(wish)
            elif job is None:
                self.summary.untouched += 1
                self._write(wish)
            elif job.key in missing:
                self._waiting[job.key].append(wish)
            elif (failure := self._known_failure(job)) is not None:
                self._fail(wish.episode, failure, job)
            elif (stored is None or job.key in stored) and self._write(wish):
                self.summary.found += 1
            else:
                missing[job.key] = job
                self._waiting[job.key].append(wish)
        return missing

    def _found_current(self, wish: Planned) -> None:
        self.summary.current.append(wish.episode)
        self._read_already.pop(wish.episode, None)
        self.labels.forget(wish.episode)
        self._note_current(wish.episode)

    def _note_current(self, episode: int) -> None:
        if episode in self._paths:
            self._recall.note_current(self._paths[episode], self.labels.path(episode))
        self._delivered(episode, "")

    def _known_failure(self, job: Job) -> Failure | None:
        failure = self.store.failure(job.key)
        # The same model fails the same way; only a crash is worth another try without being asked.
        if failure is not None and (self.settings.redo or failure.kind == "crash"):
            self.store.forget_failure(job.key)
            return None
        return failure

    def _solve(self, since: int, sensor: Sensor | None, later: GrowingSession | None) -> None:
        """Solve missing presses; recordings that come later are taken in by the same workers."""
        while not self._jobs and self._take_in(sensor, later) is not None:
            time.sleep(POLL_SECONDS)
        while self._jobs:
            sensors = {version: self.sensors[version] for version in {job.model for job in self._jobs.values()}}
            pool = self.settings.engine(
                self.store,
                self.settings.factory,
                sensors,
                self.settings.workers,
                self.settings.lease_seconds,
                self.settings.devices,
            )
            try:
                # A recording of another sensor ends this run: the next one has workers for it.
                grow = partial(self._take_in, sensor, later, set(sensors))
                since = pool.run(set(self._jobs), since, self.settle, grow, partial(self.progress, "compile"))
            finally:
                pool.close()

    def _take_in(
        self, sensor: Sensor | None, later: GrowingSession | None, models: set[str] | None = None
    ) -> set[str] | None:
        """Return keys of the presses that have come; None if no more will, or one is not of these models."""
        if later is None or later.ended:
            return None
        earlier, paths = set(self._jobs), later.new()
        if paths:
            self.plan({number: partial(read_episode, path) for number, path in paths.items()}, sensor, paths)
        added = set(self._jobs) - earlier
        return None if models and any(self._jobs[key].model not in models for key in added) else added

    def _write(self, wish: Planned) -> bool:
        """Write a label; False if its solution is missing, or was found damaged and put aside."""
        solution = self.store.get(wish.job) if wish.job else None
        if wish.job is not None and solution is None:
            return False
        try:
            full = self._read_already.pop(wish.episode, None) or self._request(wish.episode)
            if full.job != wish.job:
                raise FormatError(
                    f"the recording of episode {wish.episode} changed while it was labelled",
                    "recordings that stay as they are",
                    "run `tacdata label` again",
                )
            written = self.labels.write(full, solution)
        except FormatError as error:
            self._fail(wish.episode, Failure("recording", str(error)), wish.job)
            return True
        finally:
            self._read_already.pop(wish.episode, None)
        self.summary.written.append(wish.episode)
        if (margin := Margin.of(written)) is not None:
            self.summary.margins.append(margin)
        self._note_current(wish.episode)
        return True

    def _fail(self, episode: int, failure: Failure, job: Job | None) -> None:
        self.labels.write_failure(episode, failure, job)
        self.summary.failed[episode] = failure.reason
        self._delivered(episode, failure.reason)
