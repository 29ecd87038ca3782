"""The process that records a session, by a file in this person's folder of state: another program can stop it."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tacdata.errors import DeviceError
from tacdata.recording.live.machine_state import own_state_directory

FOLDER = "recorders"


@contextmanager
def announced(session: Path) -> Iterator[None]:
    """Keep the file of this process while the context lasts; a recording goes on without it."""
    file = own_state_directory() / FOLDER / str(os.getpid())
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(str(session.resolve()), encoding="utf-8")
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink(missing_ok=True)


def recorder_of(session: Path) -> int | None:
    """Return the process that records a session on this computer, if one does."""
    for file in (own_state_directory() / FOLDER).glob("[0-9]*"):
        with suppress(OSError):
            if file.read_text(encoding="utf-8") == str(session.resolve()) and _records(int(file.name)):
                return int(file.name)
    return None


def stop(session: Path) -> None:
    """Stop a session's recorder as Ctrl-C does: it stops the motion, lifts the tip and closes the file.

    Raises:
        DeviceError: If no process of this person records it.
    """
    process = recorder_of(session)
    if process is None:
        raise DeviceError(
            f"no process records {session}", "a recording that runs on this computer", "press Ctrl-C there"
        )
    os.kill(process, signal.SIGINT)


def _records(process: int) -> bool:
    """Return whether a process is a recorder: a crash leaves its file, and numbers of processes come back."""
    asked = subprocess.run(["ps", "-o", "args=", "-p", str(process)], capture_output=True, text=True)
    return {"record"} <= set(asked.stdout.split())
