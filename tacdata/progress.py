"""Progress of a verb and its suggested next step: the output that ``--quiet`` leaves out."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath
from shlex import quote
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn

_quiet = False


@contextmanager
def silenced(quiet: bool) -> Iterator[None]:
    """Leave progress and hints out while the block runs, if ``quiet``."""
    global _quiet
    # A verb within a quiet one stays quiet.
    previous, _quiet = _quiet, _quiet or quiet
    try:
        yield
    finally:
        _quiet = previous


def is_quiet() -> bool:
    """Return whether progress and hints are left out."""
    return _quiet


def say(words: str) -> None:
    """Print progress, or the next step."""
    if not _quiet:
        print(words, flush=True)


def suggest(*words: object) -> None:
    """Print the command to type next; paths are quoted for the shell.

    Example:
        >>> from pathlib import Path
        >>> from tacdata.progress import suggest
        >>> suggest("check", Path("my session"))
        next: tacdata check 'my session'
    """
    # Only paths are quoted: options and their values are typed as they are.
    typed = [quote(str(word)) if isinstance(word, PurePath) else str(word) for word in words]
    say(" ".join(["next: tacdata", *filter(None, typed)]))


def console() -> Console:
    """Return where spinners and words about the work go: standard error."""
    from rich.console import Console

    return Console(stderr=True, quiet=_quiet, markup=False, highlight=False, soft_wrap=True)


LEAST_DONE, LEAST_SHARE = 5, 0.02
"""Finished items [count], and their share of all [1], from which the time of the others is estimated. The first items
of a batch bear the cost of compiling and of the whole batch."""


def remaining(done: int, total: int, seconds: float) -> str:
    """Return the estimated time of the items that are not finished, such as "about 12 min left".

    Empty as long as too few are finished for an estimate, or if none is missing.

    Args:
        done: Finished items.
        total: All items.
        seconds: Time that the finished ones took [s].

    Example:
        >>> from tacdata.progress import remaining
        >>> remaining(1, 7339, 87.0), remaining(200, 7339, 174.0)
        ('', 'about 104 min left')
    """
    if done >= total or done < max(LEAST_DONE, LEAST_SHARE * total):
        return ""
    expected = seconds * (total - done) / done
    return f"about {expected:.0f} s left" if expected < 120 else f"about {expected / 60:.0f} min left"


def remaining_column() -> ProgressColumn:
    """Return a column of a progress bar with `remaining`."""
    from rich.progress import ProgressColumn as Column
    from rich.text import Text

    class Remaining(Column):
        def render(self, task: Any) -> Text:
            return Text(remaining(int(task.completed), int(task.total or 0), task.elapsed or 0.0))

    return Remaining()


def bars(*columns: str | ProgressColumn, **options: Any) -> Progress:
    """Return rich's progress bars, with its arguments."""
    from rich.console import Console
    from rich.progress import Progress

    return Progress(*columns, console=Console(quiet=True) if _quiet else None, disable=_quiet, **options)


STAGES = {
    "read": "reading recordings",
    "look": "looking for labels",
    "compile": "compiling kernels",
    "solve": "solving presses",
    "write": "writing episodes",
}
"""Stage of a job of presses -> words on its bar."""


class StageBars:
    """A bar a stage, with the time that remains; lines in place of bars where there is no terminal."""

    def __init__(self, pause: float, each_press: bool = False) -> None:
        """Make the display.

        Args:
            pause: Least time between two lines [s].
            each_press: Print a line for every solved press, and the first line about kernels at once.
        """
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

        words, elapsed = TextColumn("{task.description}"), TimeElapsedColumn()
        self._progress = bars(words, BarColumn(), MofNCompleteColumn(), elapsed, remaining_column())
        self._pause, self._each_press = pause, each_press
        self._tasks: dict[str, Any] = {}
        self._printed = -pause if each_press else 0.0
        self.solving_seconds = 0.0
        """Time from the beginning to the last press that was solved [s]."""

    def __enter__(self) -> Self:
        self._began = time.monotonic()
        if sys.stdout.isatty():
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._progress.stop()

    def show(self, stage: str, done: int, total: int) -> None:
        """Move the bar of a stage, one of `STAGES`."""
        if stage not in self._tasks:
            self._tasks[stage] = self._progress.add_task(STAGES[stage], total=total)
        self._progress.update(self._tasks[stage], completed=done)
        seconds, line = time.monotonic() - self._began, ""
        is_due = seconds - self._printed > self._pause
        if stage == "compile" and is_due:
            line = f"  compiling kernels: {done} of about {total} modules"
        if stage == "solve":
            self.solving_seconds = seconds
            if done if self._each_press else is_due:
                line = ", ".join(filter(None, [f"  press {done} of {total} solved", remaining(done, total, seconds)]))
        if line and not sys.stdout.isatty():
            self._printed = seconds
            say(line)
