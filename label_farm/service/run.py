"""One submission in progress: planned in a thread of its own, then settled job by job."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import replace
from functools import partial
from pathlib import Path

from tacdata.errors import TacdataError, UsageError
from tacdata.label_farm.labelling import Labelling
from tacdata.label_farm.labels.dataset_flow import DatasetFlow
from tacdata.label_farm.ledger.ledger import Ledger
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.presses.model import ProcessDied, Version
from tacdata.label_farm.presses.tolerance import Tolerance
from tacdata.label_farm.service.confined import confined
from tacdata.label_farm.service.submission import Submission, now
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.store import Store
from tacdata.labels import file_names

RECENT = 24
"""How many of the episodes labelled last are remembered."""
MOST_ATTEMPTS = 20
"""How often a submission is planned again after the process that builds its model was killed."""


class Run:
    """One submission in progress. After a restart it is planned again and finds finished results."""

    def __init__(
        self, submission: Submission, root: Path, store: Store, settings: FarmSettings, versions: dict[str, Version]
    ) -> None:
        """Prepare; nothing is read yet. Versions of models are shared among the runs."""
        self._versions = versions
        self.submission, self._root, self._store, self._settings = submission, root, store, settings
        self.recent: deque[int] = deque(maxlen=RECENT)
        """Episodes labelled last."""
        self.failures: dict[int, str] = {}
        """Episode -> reason why it has no label."""
        self.stage = ("waiting", 0, 0)
        self.labelling: Labelling | None = None
        self.attempts = 0
        self.planned = threading.Event()
        self._flow: DatasetFlow | None = None
        self.remark = ""
        self.cancelled = False
        self.refusal = ""
        self._since = 0
        self._labelled: set[int] = set()

    @property
    def session(self) -> Path:
        """Folder of the recordings."""
        return confined(self._root, self.submission.session, "session")

    @property
    def labelled(self) -> list[int]:
        """Episodes that have a label."""
        return sorted(self._labelled)

    def is_labelled(self, episode: int) -> bool:
        """Return whether the label of an episode exists."""
        return episode in self._labelled

    def check_paths(self) -> None:
        """Refuse a sensor file or dataset outside the root, or a sensor file that is not there.

        Raises:
            UsageError: Saying which.
        """
        wish = self.submission
        if wish.sensor and not confined(self._root, wish.sensor, "sensor file").is_file():
            raise UsageError(f"no sensor file {wish.sensor!r}", "a file that the service can see", "check the path")
        if wish.dataset:
            confined(self._root, wish.dataset, "dataset")

    def plan(self) -> None:
        """Read recordings, write labels that need no solving, enqueue the others; errors become part of its state."""
        self.attempts += 1
        try:
            self._plan()
        except TacdataError as error:
            if isinstance(error, ProcessDied) and self.attempts < MOST_ATTEMPTS and not self.cancelled:
                return  # it is planned again later
            self.refusal = str(error)
        # Jobs that were enqueued after the cancellation are withdrawn too.
        if self.cancelled:
            self.close()
        self.planned.set()

    def _plan(self) -> None:
        from tacdata.recording.files.reader import read_episode
        from tacdata.recording.session import read_session
        from tacdata.sensor import read_sensor

        wish, session = self.submission, self.session
        recorded = read_session(session)
        if not recorded.episodes:
            raise UsageError(f"{wish.session} holds no finished recording", "at least one", "record: `tacdata record`")
        self.submission = replace(wish, episodes=len(recorded.episodes))
        sensor = read_sensor(confined(self._root, wish.sensor, "sensor file")) if wish.sensor else None
        paths = {int(path.stem[-6:]): path for path in recorded.episodes}
        recordings = {number: partial(read_episode, path) for number, path in paths.items()}
        if wish.dataset:
            dataset = confined(self._root, wish.dataset, "dataset")
            self._flow = DatasetFlow(dataset, session, recorded.episodes, sensor)
        settings = replace(
            self._settings,
            ladder=Ladder(
                load_step=wish.load_step,
                unload_step=wish.unload_step,
                tolerance=Tolerance(least=wish.tolerance) if wish.tolerance else None,
            ),
            uncertainty=wish.uncertainty,
            redo=wish.redo,
            priority=wish.priority,
        )
        name = f"submission {wish.id}"
        self.labelling = Labelling(
            file_names.folder(session), self._store, settings, self._progress, self._deliver, name, self._versions
        )
        self._since = self.labelling.plan(recordings, sensor, paths)

    def _progress(self, stage: str, done: int, total: int) -> None:
        # Called for each recording: an error here ends the planning of a cancelled submission.
        if self.cancelled:
            raise UsageError("cancelled while it was planned", "a submission that goes on", "submit again")
        self.stage = (stage, done, total)

    def _deliver(self, episode: int, reason: str) -> None:
        if reason:
            self.failures[episode] = reason
        else:
            self.failures.pop(episode, None)
            self._labelled.add(episode)
            self.recent.append(episode)
        if self._flow is not None:
            try:
                self._flow.deliver(episode, reason)
            except TacdataError as error:  # the labels go on; the dataset is reported as unfit
                self._flow, self.remark = None, f"nothing flows into {self.submission.dataset}: {error}"

    def settle(self, ledger: Ledger) -> int:
        """Process jobs that were solved or failed since the last call; return how many."""
        if self.labelling is None:
            return 0
        changes = ledger.changes(self._since)
        for change in changes:
            self.labelling.settle(change)
            self._since = change.number
        return len(changes)

    def state(self) -> Submission:
        """Return the state of the submission."""
        counted = replace(self.submission, labelled=len(self._labelled), failed=len(self.failures), reason=self.remark)
        if self.cancelled:
            return replace(counted, state="cancelled", finished_at=now())
        if self.refusal:
            return replace(counted, state="refused", reason=self.refusal, finished_at=now())
        if not self.planned.is_set():
            return replace(counted, state="planning" if self.stage[0] != "waiting" else "waiting")
        if self.labelling is not None and self.labelling.pending:
            return replace(counted, state="running")
        return replace(counted, state="done", finished_at=now())

    def close(self) -> None:
        """Withdraw open jobs."""
        if self.labelling is not None:
            self.labelling.close()
        if self._flow is not None:
            try:
                self._flow.say()
            except TacdataError as error:
                self.remark = f"{self.submission.dataset} cannot say what is in it: {error}"
