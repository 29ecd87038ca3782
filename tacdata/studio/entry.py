"""One row of the page: a session, dataset, network, verdict, revision, health page or farm."""

import re
import shlex
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

COMMAND = re.compile(r"`(tacdata [^`]+)`")
"""A command in a sentence."""
PAGES = (".html", ".png", ".gif", ".md")
"""Endings of files that a browser shows."""
MOST_PAGES = 8
"""Pages of an entry that have a link."""


@dataclass(frozen=True)
class LabEntry:
    """What is known of one entry, in words."""

    section: str
    """Heading that it stands under."""
    path: str
    """From the lab's folder on."""
    sentence: str
    tone: str = ""
    """Colour of the sentence: good, bad or neither."""
    facts: tuple[str, ...] = ()
    """Short words, each with its unit."""
    faults: tuple[str, ...] = ()
    """Faults, a sentence each."""
    date: str = ""
    """Local date and time, to the minute."""
    commands: tuple[str, ...] = ()
    """Commands, filled in, to be typed in the lab's folder; the likeliest first."""
    pages: tuple[str, ...] = ()
    """Files that a browser shows, from the lab's folder on."""
    running: bool = False
    """Whether it changes at this moment."""
    can_stop: bool = False
    """Whether the page can stop it."""
    address: str = ""
    """Address of a page that another program serves."""
    share: float | None = None
    """Share of the work that is done [1]; None where nothing is counted."""
    order: float = field(default=0.0, compare=False)
    """Time to sort by [s since 1970]."""


def command(*words: object) -> str:
    """Return a command of tacdata, its words quoted for a shell."""
    return shlex.join(["tacdata", *map(str, words)])


def local_minute(time: float) -> str:
    """Return a time [s since 1970] as local date and time."""
    return datetime.fromtimestamp(time).strftime("%Y-%m-%d %H:%M")


def pages_in(root: Path, *folders: Path) -> tuple[str, ...]:
    """Return the files of some folders that a browser shows, pages before pictures, from the root on."""
    files = [path for folder in folders if folder.is_dir() for path in sorted(folder.iterdir())]
    pages = [path for path in files if path.suffix in PAGES and not path.name.startswith(".") and path.is_file()]
    # Pages to read first, then pictures.
    pages.sort(key=lambda path: PAGES.index(path.suffix))
    return tuple(path.relative_to(root).as_posix() for path in pages[:MOST_PAGES])
