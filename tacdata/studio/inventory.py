"""Everything that a lab has under a folder, read anew where a file has changed."""

import time
from collections.abc import Callable
from pathlib import Path

from tacdata.errors import TacdataError, UsageError
from tacdata.studio.entry import LabEntry, local_minute
from tacdata.studio.farm import LOCK, farm_entry
from tacdata.studio.measured import SECTION as MEASURED
from tacdata.studio.measured import measured_entry, measured_sources
from tacdata.studio.results import (
    dataset_entry,
    health_entry,
    network_entry,
    other_entry,
    revision_entry,
    verdict_entry,
)
from tacdata.studio.sessions import RUNNING, SECTION, session_entry
from tacdata.viewers.kinds.kind import Kind, contents, kind_of

SECTIONS = (
    RUNNING,
    SECTION,
    "Datasets",
    "Networks",
    "Verdicts",
    "Revisions",
    "Health",
    "Label farm",
    MEASURED,
    "Pages",
    "Others",
)
"""Headings of the page, in this order."""
MAKERS: dict[str, tuple[str, Callable[[Path, Path], LabEntry]]] = {
    "SessionKind": (SECTION, session_entry),
    "DatasetKind": ("Datasets", dataset_entry),
    "PredictionsKind": ("Networks", network_entry),
    "VerdictKind": ("Verdicts", verdict_entry),
    "RevisionKind": ("Revisions", revision_entry),
}
"""Class of a kind that `tacdata view` knows -> section, function of its entry."""
WATCHED = ("", "labels", "meta", "scores", "submissions", "session.json", "check.json", LOCK)
"""Parts of an entry's folder whose change makes its entry be read anew."""
SEARCH = 10.0
"""Time between two searches for new entries [s]."""
LEVELS = ("", "*/", "*/*/")
"""Places of health pages, farms and pages, from the folder on."""

Task = tuple[str, Path, Callable[[Path, Path], LabEntry]]


class Inventory:
    """The entries of a folder."""

    def __init__(self, root: Path) -> None:
        """Take a folder.

        Raises:
            UsageError: If there is none.
        """
        if not root.is_dir():
            raise UsageError(f"no folder {root}", "a folder with sessions, datasets, verdicts", "name one")
        self.root = root.resolve()
        self._tasks: list[Task] = []
        self._searched = -SEARCH
        self._cache: dict[tuple[str, Path], tuple[tuple[int, ...], LabEntry]] = {}

    def entries(self) -> list[LabEntry]:
        """Return the entries by section, the newest first; a damaged one has its error as its sentence."""
        # Walking through a lab's folder takes longer than the page's pause between two looks.
        if time.monotonic() - self._searched >= SEARCH:
            self._tasks, self._searched = self._tasks_of_folder(), time.monotonic()
        # What was deleted since the last search is left out.
        current = [self._entry(task) for task in self._tasks if task[1].exists()]
        return sorted(current, key=lambda entry: (SECTIONS.index(entry.section), -entry.order, entry.path))

    def _tasks_of_folder(self) -> list[Task]:
        kind = kind_of(self.root)
        kinds = {self.root: kind} if kind.holds(self.root) else contents(self.root)
        tasks = [_task(path, kind) for path, kind in kinds.items()]
        for section, name, make in (("Health", "health.json", health_entry), ("Label farm", LOCK, farm_entry)):
            tasks += [(section, path.parent, make) for path in self._placed(name)]
        folders = {folder for _, folder, _ in tasks}
        occupied = folders if kind.holds(self.root) else folders - {self.root}
        tasks += [
            (MEASURED, path, measured_entry) for path in measured_sources(self.root, self._placed("*.*"), occupied)
        ]
        pages = [path for path in self._placed("*.html") if not folders & set(path.parents) - {self.root}]
        return tasks + [("Pages", path, page_entry) for path in pages]

    def _placed(self, pattern: str) -> list[Path]:
        """Return files near the folder, none in hidden folders."""
        files = [path for level in LEVELS for path in sorted(self.root.glob(level + pattern))]
        return [path for path in files if not any(part.startswith(".") for part in path.relative_to(self.root).parts)]

    def _entry(self, task: Task) -> LabEntry:
        section, path, make = task
        state = tuple(_changed(path / part) for part in WATCHED)
        cached = self._cache.get((section, path))
        # A running recording changes without its watched files: it is always read.
        if cached is not None and cached[0] == state and not cached[1].running:
            return cached[1]
        try:
            entry = make(self.root, path)
        except Exception as error:  # whatever is damaged, the others are listed
            words = f"{error.given}; {error.remedy}" if isinstance(error, TacdataError) else f"not readable: {error!r}"
            words = words.replace(f"{self.root}/", "")
            entry = LabEntry(section, path.relative_to(self.root).as_posix(), words, "bad")
        self._cache[section, path] = state, entry
        return entry


def page_entry(root: Path, file: Path) -> LabEntry:
    """Return the entry of a page that belongs to no other."""
    name, changed = file.relative_to(root).as_posix(), file.stat().st_mtime
    return LabEntry("Pages", name, "", date=local_minute(changed), pages=(name,), order=changed)


def _task(path: Path, kind: Kind) -> Task:
    noun = kind.NOUN
    section, make = MAKERS.get(type(kind).__name__, ("Others", lambda root, folder: other_entry(root, folder, noun)))
    return section, path, make


def _changed(path: Path) -> int:
    """Return when a file was changed [ns since 1970]; 0 without it."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
