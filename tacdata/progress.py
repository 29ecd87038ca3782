"""Progress of a verb and its suggested next step: the output that ``--quiet`` leaves out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath
from shlex import quote
from typing import TYPE_CHECKING, Any

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

    return Console(stderr=True, quiet=_quiet)


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
