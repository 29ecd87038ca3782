"""State of a session's recording, by its files: presses done, time left, latest fault."""

import statistics
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from tacdata.recording.files import file_names

QUIET = 60.0
"""Longest time without a change of the newest recording while a session runs [s]: a change of indenters by hand."""
RECENT = 10
"""Latest presses whose duration tells the time left [count]."""


@dataclass(frozen=True)
class RecordingState:
    """What the files of a session say about its recording."""

    done: int
    """Finished presses."""
    wanted: int
    """Presses of the plan."""
    current: Path | None
    """The recording that is being written, if any."""
    running: bool
    """Whether presses go on."""
    seconds_left: float | None
    """Time left [s]; None where it is unknown."""
    cut: Path | None
    """A recording without an end that nobody writes any more."""
    fault: str
    """Why the latest interrupted press was broken off; empty without one."""
    newest: float
    """Latest change of a recording [s since 1970]."""


def recording_state(folder: Path, planned: int) -> RecordingState:
    """Return the state of a session's recording.

    Args:
        folder: The session.
        planned: Presses of its plan.
    """
    finished = list(file_names.finished(folder).values())
    taps = sorted(folder.glob("sync_tap-*.mcap"))
    ended = sorted(path.stat().st_mtime for path in finished)
    changes = {path: _changed(path) for path in (*finished, *taps, *file_names.unfinished(folder))}
    newest = max(changes, key=changes.__getitem__, default=None)
    if newest is None:
        return RecordingState(0, planned, None, False, None, None, "", _changed(folder))
    age = time.time() - changes[newest]
    is_partial, is_interrupted = newest.name.endswith(file_names.PARTIAL), ".interrupted-" in newest.name
    remaining = planned - len(finished)
    running = age < QUIET and remaining > 0 and not is_interrupted
    steps = [later - earlier for earlier, later in pairwise(ended)][-RECENT:]
    seconds = remaining * statistics.median(steps) - (time.time() - ended[-1]) if running and steps else None
    cut = [path for path in changes if path.name.endswith(file_names.PARTIAL) and not (running and path == newest)]
    interrupted = [path for path in changes if ".interrupted-" in path.name]
    return RecordingState(
        len(finished),
        planned,
        newest if running and is_partial else None,
        running,
        None if seconds is None else max(seconds, 0.0),
        max(cut, key=changes.__getitem__, default=None),
        broken_off(max(interrupted, key=changes.__getitem__)) if interrupted else "",
        changes[newest],
    )


def broken_off(path: Path) -> str:
    """Return why a recording was broken off, by its index of metadata; what the file says, or that it is damaged."""
    from mcap.reader import SeekingReader

    try:
        with path.open("rb") as stream:
            reasons = [m.metadata["reason"] for m in SeekingReader(stream).iter_metadata() if m.name == "episode"]
    except Exception as error:  # any damage of a file is a fault in words
        return f"{path.name} cannot be read: {error or type(error).__name__}"
    return reasons[-1] if reasons else f"{path.name} has no end"


def _changed(path: Path) -> float:
    """Return when a file was changed [s since 1970]; 0 where it has got another name since."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0
