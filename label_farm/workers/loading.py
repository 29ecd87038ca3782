"""A worker's words about the kernels that it compiles or loads, on the roster; and their figures again."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager

_WORDS = re.compile(r"compiles or loads kernels: (\d+) of about (\d+) modules")
PAUSE_SECONDS = 1.0
"""Least time between two words [s]: kernels that are compiled already load in less, without a word."""


class Loading:
    """Notes how many modules of kernels this process has loaded."""

    def __init__(self, note: Callable[[str], None]) -> None:
        """Bind the note of a desk."""
        self._note, self._spoke, self._noted = note, time.monotonic(), False
        self._reports: ExitStack | None = None

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Listen within the context: Warp outlives a worker and its desk."""
        with ExitStack() as self._reports:
            self.begin()
            yield
        self._reports = None

    def begin(self) -> None:
        """Listen, if this process has begun to use kernels at all."""
        self._spoke = time.monotonic()
        if self._reports and (runtime := sys.modules.get("tacdata.warp_runtime")):
            self._reports.enter_context(runtime.report_modules(self.loaded))

    def loaded(self, count: int, about: int) -> None:
        """Note the number of modules so far, of all."""
        if time.monotonic() - self._spoke >= PAUSE_SECONDS:
            self._spoke, self._noted = time.monotonic(), True
            self._note(f"compiles or loads kernels: {count} of about {about} modules")

    def end(self) -> None:
        """Clear the note, once a press is settled."""
        if self._noted:
            self._noted = False
            self._note("")


def modules_of(notes: Iterable[str]) -> tuple[int, int] | None:
    """Return the modules so far and of all of the worker that has loaded most; None if nobody loads any.

    Example:
        >>> from tacdata.label_farm.workers.loading import modules_of
        >>> modules_of(["", "compiles or loads kernels: 12 of about 29 modules"])
        (12, 29)
    """
    found = [(int(match[1]), int(match[2])) for match in map(_WORDS.fullmatch, notes) if match]
    return max(found, default=None)
