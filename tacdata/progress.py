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
    typed = [quote(str(word)) if isinstance(word, PurePath) else str(word) for word in words]
    say(" ".join(["next: tacdata", *filter(None, typed)]))


def console() -> Console:
    """Return where spinners and words about the work go: standard error."""
    from rich.console import Console

    return Console(stderr=True, quiet=_quiet)


def bars(*columns: str | ProgressColumn, **options: Any) -> Progress:
    """Return rich's progress bars, with its arguments."""
    from rich.console import Console
    from rich.progress import Progress

    return Progress(*columns, console=Console(quiet=True) if _quiet else None, disable=_quiet, **options)
