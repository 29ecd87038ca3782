"""Holds Ctrl-C back while something moves, until the motion's watcher asks for it.

Python raises KeyboardInterrupt wherever the main thread happens to be. While a lock is taken that becomes a
RuntimeError; in a finalizer it is lost, and the machine would go on.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from tacdata.host import COMPUTER, Host

LAST_WORDS = 3.0
"""Time in which the last lines of a session are not broken off by one more Ctrl-C [s, real time]."""


class Interruption:
    """Takes Ctrl-C, SIGTERM, and SIGHUP unless it is ignored (nohup), while its context lasts; for the main thread.

    Example:
        ``with Interruption() as interruption, interruption.kept(): ...; interruption.check()``
    """

    def __init__(self, host: Host = COMPUTER) -> None:
        """Create it; no signal is taken yet."""
        self._host = host
        self._asked = self._answered = self._keeping = False
        self._deaf_until: float | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        """Take the signals, also where a shell started this in the background and ignores Ctrl-C."""
        hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
        numbers = [signal.SIGINT, signal.SIGTERM]
        if hang_up is not None and signal.getsignal(hang_up) == signal.SIG_DFL:
            numbers.append(hang_up)
        self._before = {number: self._host.signal(number, self._heard) for number in numbers}
        return self

    def __exit__(self, *exception: object) -> None:
        """Restore the previous signal handlers."""
        for number, handler in self._before.items():
            self._host.signal(number, handler)

    def check(self) -> None:
        """Raise the signal of the meantime.

        Raises:
            KeyboardInterrupt: If a signal came that was not raised yet.
        """
        if self._asked and not self._answered:
            self._answered = True
            raise KeyboardInterrupt

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Hold the first signal until `check` or the end; a second one is raised at once."""
        with self._set(True):
            yield
        self.check()

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Within `kept`: raise signals at once; a question to a person would not end otherwise."""
        with self._set(False):
            self.check()
            yield

    def last_words(self) -> None:
        """From now on hear no signal, so that the last lines reach the screen; a disk that hangs still ends it."""
        self._deaf_until = self._host.monotonic() + LAST_WORDS

    @contextmanager
    def _set(self, keeping: bool) -> Iterator[None]:
        previous, self._keeping = self._keeping, keeping
        try:
            yield
        finally:
            self._keeping = previous

    def _heard(self, number: int, frame: FrameType | None) -> None:
        if self._keeping and not self._asked:
            self._asked = True
            return
        if self._deaf_until is not None and self._host.monotonic() < self._deaf_until:
            return
        raise KeyboardInterrupt
