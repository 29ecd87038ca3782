"""The thread that processes submissions: plans them, tends the workers, writes labels."""

from __future__ import annotations

import fcntl
import os
import sqlite3
import threading
import time
import traceback
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

from tacdata.errors import TacdataError, UsageError
from tacdata.label_farm.labels.session_labels import SessionLabels
from tacdata.label_farm.ledger.ledger import Ledger
from tacdata.label_farm.ledger.roster import Roster, WorkerRow
from tacdata.label_farm.presses.model import Version
from tacdata.label_farm.service.gauges import Gauges
from tacdata.label_farm.service.run import RECENT, Run
from tacdata.label_farm.service.submission import OPEN, Submission, Submissions
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.engine import Engine, StoreFull

ROUND_SECONDS = 0.1
PAUSE_SECONDS = 5.0
MOST_SHOWN = 100
"""Most failures that are shown of a submission."""
SAMPLE_SECONDS = 2.0
"""How often throughput and workers are looked at [s]."""
KEPT_RUNS = 200
"""How many finished submissions keep their list of failures in memory."""


class Foreman:
    """Processes submissions until stopped. Every method may be called from any thread."""

    def __init__(self, root: Path, store: Store, settings: FarmSettings) -> None:
        """Take up the store and the open submissions of its last service.

        Args:
            root: Folder that sessions are named from.
            store: Where solved paths, ledger and submissions lie.
            settings: Model, engine, workers; the rest comes with each submission.

        Raises:
            UsageError: If another service works on the store.
        """
        self.root, self.store, self._settings = root, store, settings
        self._lock_file = _lock(store.folder)
        self.submissions = Submissions(store.folder)
        self.gauges, self._sampled = Gauges(), -SAMPLE_SECONDS
        self._pauses = {"plan": "", "work": ""}
        self._versions: dict[str, Version] = {}
        self._guard = threading.RLock()
        self._runs: dict[str, Run] = {}
        self._finished: dict[str, tuple[list[int], dict[str, str]]] = {}
        self._stop = threading.Event()
        for submission in self.submissions.listing():
            if submission.state in OPEN:
                self._runs[submission.id] = self._run(submission)
        self._threads = [threading.Thread(target=loop, daemon=True) for loop in (self._plan_all, self._work)]
        self._began = False

    def announce(self, address: str) -> None:
        """Write this service's address into the lock, for whoever tries to start a second one."""
        os.ftruncate(self._lock_file, 0)
        os.pwrite(self._lock_file, f"{address} (process {os.getpid()})\n".encode(), 0)

    def start(self) -> None:
        """Begin."""
        self._began = True
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop the workers and give their jobs back; submissions stay open for the next service."""
        self._stop.set()
        for thread in self._threads:
            if self._began:
                thread.join(20.0)
        os.close(self._lock_file)

    def submit(self, wish: Submission) -> Submission:
        """File a submission; it is on the disk when this returns.

        Raises:
            UsageError: If its session or sensor is missing, or outside the root.
        """
        run = self._run(wish)
        if not run.session.is_dir():
            raise UsageError(
                f"no session {wish.session!r} in the service's {self.root.name}/",
                f"a folder of recordings, named as seen from {self.root.name}/",
                "leave out the way to it, or bring it there: tacdata farm send SESSION",
            )
        run.check_paths()
        with self._guard:
            filed = self.submissions.add(wish)
            self._runs[filed.id] = self._run(filed)
        return filed

    def cancel(self, number: str) -> Submission:
        """Cancel a submission: jobs that it alone wants leave the queue, finished labels stay.

        Raises:
            UsageError: If there is none of that number, or it is finished.
        """
        with self._guard:
            run = self._open(number)
            run.cancelled = True
            run.close()
            self.submissions.keep(run.state())
            return self.submissions.get(number)

    def prioritize(self, number: str, priority: int) -> Submission:
        """Change a submission's priority.

        Raises:
            UsageError: If there is none of that number, or it is finished.
        """
        with self._guard, Ledger(self.store.ledger_path) as ledger:
            run = self._open(number)
            run.submission = replace(run.submission, priority=priority)
            self.submissions.keep(run.state())
            ledger.prioritize(f"submission {number}", priority)
            return self.submissions.get(number)

    def states(self) -> list[tuple[Submission, Run | None]]:
        """Return the state of every submission, with its run if it has one, the oldest first."""
        with self._guard:
            runs = dict(self._runs)
            listed = self.submissions.listing()
        return [(runs[s.id].state() if s.id in runs and s.state in OPEN else s, runs.get(s.id)) for s in listed]

    @property
    def lease_seconds(self) -> float:
        """How long a silent worker keeps its job [s]."""
        return self._settings.lease_seconds

    def session(self, number: str) -> Path:
        """Return the session's folder of a submission.

        Raises:
            UsageError: If there is none of that number.
        """
        return self._run(self.submissions.get(number)).session

    def results(self, number: str) -> tuple[list[int], list[int]]:
        """Return the episodes of a submission that have a label, and those that failed.

        Raises:
            UsageError: If there is none of that number, or it left the session's labels as they were.
        """
        run = self._with_results(number)
        if run is not None:
            return run.labelled, sorted(run.failures)
        labels = SessionLabels.of(self.session(number))
        return labels.labelled, labels.failed

    def finished(self, number: str) -> tuple[list[int], dict[str, str]]:
        """Return some labelled episodes of a submission, the last first, and some failures, to be shown.

        Of one that was done before a restart the files are looked at once, and the highest numbers taken for the last.
        """
        with self._guard:
            run = self._runs.get(number)
        if run is not None:
            failures = sorted(run.failures.items())[:MOST_SHOWN]
            return list(run.recent)[::-1], {str(episode): reason for episode, reason in failures}
        if number not in self._finished:
            submission, finished = self.submissions.get(number), ([], {})
            with suppress(UsageError):  # its folder may be gone by now
                labels = SessionLabels.of(self.session(number))
                if submission.state == "done":
                    finished = labels.labelled[-RECENT:][::-1], labels.failures(MOST_SHOWN)
            self._finished[number] = finished
        return self._finished[number]

    def is_labelled(self, number: str, episode: int) -> bool:
        """Return whether a submission's label of an episode exists; raises as `results`."""
        run = self._with_results(number)
        if run is not None:
            return run.is_labelled(episode)
        return SessionLabels.of(self.session(number)).path(episode).exists()

    def _with_results(self, number: str) -> Run | None:
        """Return the run of a submission that has results; None if it is done and its run is not kept any more."""
        submission = self.submissions.get(number)
        with self._guard:
            run = self._runs.get(number)
        if run is not None and submission.state in OPEN:
            submission = run.state()  # the file follows at the next round
        if submission.state != "refused" and (run is not None or submission.state == "done"):
            return run
        raise UsageError(
            f"submission {number} is {submission.state}" + (f": {submission.reason}" if submission.reason else ""),
            "one that is worked on or done",
            "submit the session again: what is finished is found at once",
        )

    def workers(self) -> list[WorkerRow]:
        """Return the workers."""
        with Ledger(self.store.ledger_path) as ledger:
            return Roster(ledger).listing()

    def _open(self, number: str) -> Run:
        submission = self.submissions.get(number)
        run = self._runs.get(number)
        if run is None or submission.state not in OPEN:
            raise UsageError(f"submission {number} is {submission.state}", "one that is not finished", "submit again")
        return run

    def _run(self, submission: Submission) -> Run:
        return Run(submission, self.root, self.store, self._settings, self._versions)

    def _hire(self) -> Engine:
        settings = self._settings
        return settings.engine(
            self.store, settings.factory, None, settings.workers, settings.lease_seconds, settings.devices
        )

    def _plan_all(self) -> None:
        while not self._stop.is_set():
            with self._guard:
                waiting = [run for run in self._runs.values() if not run.planned.is_set() and not run.cancelled]
            if not waiting:
                time.sleep(ROUND_SECONDS)
                continue
            # Fewest attempts first: a submission whose planning fails must not hold up the others.
            run = min(waiting, key=lambda r: (r.attempts, -r.submission.priority, r.submission.id))
            try:
                run.plan()
                self._pauses["plan"] = ""
            except (OSError, sqlite3.OperationalError) as error:
                self._pause("plan", f"planning stopped: {error}")
            except Exception as error:  # a fault of ours must not end the service: it is shown
                traceback.print_exc()
                run.refusal = f"unexpected {type(error).__name__}: {error}"
                run.planned.set()

    def _work(self) -> None:
        while not self._stop.is_set():
            try:
                self._work_until_stopped()
            except (StoreFull, OSError, sqlite3.OperationalError, TacdataError) as error:
                self._pause("work", str(error).splitlines()[0])
            except Exception as error:  # a fault of ours must not end the service: it is shown
                traceback.print_exc()
                self._pause("work", f"unexpected {type(error).__name__}: {error}")

    def _work_until_stopped(self) -> None:
        with Ledger(self.store.ledger_path, self._settings.lease_seconds) as ledger, closing(self._hire()) as pool:
            ledger.release_dead()
            while not self._stop.is_set():
                self._round(ledger, pool)
                self._pauses["work"] = ""
                time.sleep(ROUND_SECONDS)

    @property
    def paused(self) -> str:
        """Why the farm is paused, in words; "" if it is not."""
        return "; ".join(filter(None, dict.fromkeys(self._pauses.values())))

    def _pause(self, what: str, why: str) -> None:
        """Wait: a full disk or a machine without memory may be mended, and nothing is lost meanwhile."""
        self._pauses[what] = why
        self._stop.wait(PAUSE_SECONDS)

    def _round(self, ledger: Ledger, pool: Engine) -> None:
        settled = 0
        with self._guard:
            running = [(number, run) for number, run in self._runs.items() if run.planned.is_set()]
        for number, run in running:
            if self.submissions.get(number).state not in OPEN:
                continue
            settled += run.settle(ledger)
            with self._guard:
                state = run.state()
                if state.state != self.submissions.get(number).state:
                    self.submissions.keep(state)
                    if state.state not in OPEN:
                        run.close()
        pool.tend(ledger.unsettled(self._settings.workers), settled > 0)
        self._sample(ledger)
        self._forget_old()

    def _sample(self, ledger: Ledger) -> None:
        if time.monotonic() - self._sampled < SAMPLE_SECONDS:
            return
        self._sampled = time.monotonic()
        _, _, solved, failed = ledger.counts().values()
        self.gauges.count(solved, failed)
        self.gauges.measure(row.owner for row in Roster(ledger).listing())

    def _forget_old(self) -> None:
        with self._guard:
            finished = [n for n in self._runs if self.submissions.get(n).state not in OPEN]
            for number in finished[:-KEPT_RUNS]:
                del self._runs[number]


def _lock(folder: Path) -> int:
    handle = os.open(folder / "service.lock", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        served = os.read(handle, 1000).decode(errors="replace").strip()
        os.close(handle)
        raise UsageError(
            f"another service works on {folder}" + (f": {served}" if served else ""),
            "one service a store",
            "submit to that one, or name another folder with --store",
        ) from None
    return handle
