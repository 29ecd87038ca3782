"""A session that is still being recorded: which presses have come since it was last looked at."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from tacdata.errors import TacdataError
from tacdata.recording.session import read_session

LOOK_SECONDS = 1.0
"""Time between two looks at the folder [s]."""

SILENCE_SECONDS = 300.0
"""Time without a new recording after which the session counts as stopped [s]: several times the duration of a press."""


class GrowingSession:
    """A folder that `tacdata record` fills. It may not exist yet."""

    def __init__(self, folder: Path, numbers: Iterable[int] = (), silence: float | None = None) -> None:
        """Begin to watch.

        Args:
            folder: The session.
            numbers: Presses that were taken already.
            silence: Time without a new recording after which it counts as stopped [s]; by default `SILENCE_SECONDS`.
        """
        self.folder, self._known = folder, set(numbers)
        self._silence = SILENCE_SECONDS if silence is None else silence
        self.ended = False
        """Whether no more is waited for: the plan is done, or nothing came for long."""
        self.remaining = 0
        """Presses of the plan that are not recorded."""
        self._last, self._next = time.monotonic(), 0.0

    def new(self) -> dict[int, Path]:
        """Return finished recordings that were not returned before, by number."""
        clock = time.monotonic()
        if self.ended or clock < self._next:
            return {}
        self._next = clock + LOOK_SECONDS
        try:
            session = read_session(self.folder)
        except TacdataError:
            # Not there yet, or just being written.
            self.ended = clock - self._last > self._silence
            return {}
        recordings = {int(path.stem[-6:]): path for path in session.episodes}
        fresh = {number: path for number, path in recordings.items() if number not in self._known}
        self._known |= set(fresh)
        self._last = clock if fresh else self._last
        self.remaining = len(session.remaining)
        self.ended = self.remaining == 0 or clock - self._last > self._silence
        return fresh
