"""Records demonstrations from a terminal: Enter begins one, Enter ends it."""

from __future__ import annotations

import select
import signal
import sys
from pathlib import Path

from tacdata.demonstrations.recording.reader import TIMELY, times_known
from tacdata.demonstrations.recording.recorder import DemoRecorder
from tacdata.demonstrations.recording.rig import read_demo_rig
from tacdata.demonstrations.recording.session import DemoSession, open_demo_session
from tacdata.errors import UsageError
from tacdata.recording.files import file_names
from tacdata.recording.live.detection_process import in_background
from tacdata.tags import look


def record_by_hand(rig: Path, folder: Path, task: str, seconds: float | None, count: int, resume: bool) -> DemoSession:
    """Record demonstrations into a folder; print progress and warnings.

    Args:
        rig: Demo rig file.
        folder: Folder to create, or to add to with ``resume``.
        task: Name of the task.
        seconds: Length of each demonstration [s of the rig's clock]; None: until Enter or Ctrl-C.
        count: Number of demonstrations; with ``seconds`` they follow each other without being asked.
        resume: Add to an existing folder.

    Raises:
        UsageError: If an argument does not fit, or the folder exists.
        DeviceError: If a finger or camera is missing or silent, or the disk refuses the recording.
    """
    if seconds is not None and seconds <= 0:
        raise UsageError(f"--seconds {seconds:g}", "more than 0", "leave it out to end each demonstration by Enter")
    bench = read_demo_rig(rig)
    asks = sys.stdin.isatty() and seconds is None
    session = open_demo_session(folder, bench, task, resume)
    stop = _Stop()
    with in_background(look) as detect:
        try:
            with DemoRecorder(session, bench, detect, lambda words: print(f"  {words}", flush=True)) as recorder, stop:
                for number in range(count):
                    if asks:
                        input(f"demonstration {number + 1} of {count}: Enter begins, Enter ends ")
                    else:
                        length = f"{seconds:g} s" if seconds is not None else "until Ctrl-C"
                        print(f"demonstration {number + 1} of {count}: recording {length}", flush=True)
                    path = recorder.record(stop.asked if not asks else lambda: stop.asked() or _enter(), seconds)
                    print(f"  {path.name}: {_times_known(path)}", flush=True)
                    if stop.asked():
                        break
                return recorder.session
        # After Ctrl-C, too, a person reads what is on the disk.
        except BaseException as error:
            # An empty folder would refuse the same command a second time.
            _forget_if_empty(folder, resume)
            error.add_note(_ending(folder))
            raise


def _times_known(path: Path) -> str:
    """Return how well the times of a recording's images are known, as a sentence, and a remedy for poor ones."""
    uncertainties = times_known(path)
    if not uncertainties:
        return "too few images to know their times: record again"
    best = min(uncertainties.values())
    return f"times known to {best:.3f} s" if best <= TIMELY else f"times known to {best:.2f} s: record again"


def _ending(folder: Path) -> str:
    """Return the last lines on the screen: files on the disk, and the next command."""
    if not folder.is_dir():
        return "  data:   nothing was written\n  then:   the same command"
    broken = file_names.unfinished(folder)
    lines = [f"data:   {len(file_names.finished(folder))} demonstrations are complete in {folder}"]
    lines += [f"data:   broken off, readable: {', '.join(path.name for path in broken[-3:])}"] if broken else []
    return "\n".join(f"  {line}" for line in [*lines, "then:   the same command with --resume"])


def _enter() -> bool:
    """Return whether Enter was pressed."""
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    return bool(ready and sys.stdin.readline() is not None)


def _forget_if_empty(folder: Path, resume: bool) -> None:
    """Delete a new folder without any recording, so that the same command can be repeated."""
    # The one file is the session's own document.
    if not resume and folder.is_dir() and len(list(folder.iterdir())) == 1:
        for path in folder.iterdir():
            path.unlink()
        folder.rmdir()


class _Stop:
    """The first Ctrl-C ends the demonstration and keeps it complete; the second interrupts it."""

    def __init__(self) -> None:
        self._asked = False
        self._before = None

    def asked(self) -> bool:
        return self._asked

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGINT, self._take)

    def __exit__(self, *exception: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _take(self, number: int, frame: object) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
