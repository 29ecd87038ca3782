"""Runs command lines one after the other, as a person would type them: shown, timed, and interruptible."""

from __future__ import annotations

import functools
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from tacdata.errors import DeviceError, TacdataError

_YIELDING = 10
"""Niceness of a background verb that leaves the processor to others."""

_TAIL = 40
"""Lines shown of the output of a background verb that has ended."""

PATIENCE = 60.0
"""Time for an interrupted verb to stop the motion and close its files [s]."""

LIFELINE = "TACDATA_LIFELINE"
"""Environment variable with a stage's pipe, which closes when the process that runs the stages is gone."""


class StageError(TacdataError):
    """A stage ended with an error that the person has already read."""

    def __init__(self, number: int, line: str, code: int, remains: str) -> None:
        # A stage that a signal ended has a negative code, which no shell knows.
        self.exit_code = code if 0 < code < 256 else 1
        super().__init__(
            f"stage {number} ended with exit code {code}: {line}", "exit code 0", f"see the message above; {remains}"
        )


def command_line(arguments: list[str]) -> list[str]:
    """Return the process arguments of ``tacdata ARGUMENTS`` in this installation."""
    return [sys.executable, "-m", "tacdata", *arguments]


def written(arguments: list[str]) -> str:
    """Return ``tacdata ARGUMENTS`` as it would be typed."""
    return shlex.join(["tacdata", *arguments])


class Line:
    """Runs verbs one after the other and shows each one's command, number and time."""

    def __init__(self, total: int, remains: str) -> None:
        """Prepare for ``total`` stages; ``remains`` describes the remaining work if one fails."""
        self.total, self.kept = total, remains
        self.number = 0
        self.begin = time.monotonic()

    def run(self, purpose: str, arguments: list[str], tolerated: int = 0) -> None:
        """Run ``tacdata ARGUMENTS``; ``purpose`` describes it.

        An exit code in ``tolerated`` is shown and does not end the line: the next verb can use the files that exist.

        Raises:
            StageError: With the verb's exit code, if it fails.
            KeyboardInterrupt: If interrupted, once the verb has closed its files.
        """
        started = self._announce(purpose)
        print(f"$ {written(arguments)}", flush=True)
        self._end(arguments, _run(command_line(arguments)), tolerated, started)

    def join(self, purpose: str, background: Background, tolerated: int = 0) -> None:
        """Wait for a verb that was begun in the background, and show its output from here on; as `run`."""
        started = self._announce(purpose)
        self._end(background.arguments, background.follow(), tolerated, started)

    def skip(self, count: int, reason: str) -> None:
        """Pass over ``count`` finished stages and print the reason."""
        self.number += count
        print(f"\n[{self.number}/{self.total}] {reason}", flush=True)

    def _announce(self, purpose: str) -> float:
        self.number += 1
        started = time.monotonic()
        print(f"\n[{self.number}/{self.total}] {purpose}   (after {clock_face(started - self.begin)})", flush=True)
        return started

    def _end(self, arguments: list[str], code: int, tolerated: int, started: float) -> None:
        if code not in (0, tolerated):
            raise StageError(self.number, written(arguments), code, self.kept)
        if code:
            print(f"    exit code {code}: going on with what there is", flush=True)
        print(f"    done in {clock_face(time.monotonic() - started)}", flush=True)


def _run(line: list[str]) -> int:
    # With ``--json`` words go to standard error, those of the stages too: standard output is the result alone.
    process = _start(line, stdout=sys.stderr if sys.stdout is sys.stderr else None)
    try:
        return process.wait()
    except BaseException:
        stop(process)
        raise


def _start(line: list[str], **streams: Any) -> subprocess.Popen:
    pipe = _lifeline()
    return subprocess.Popen(
        line,
        stdin=subprocess.DEVNULL,
        # A process group of its own: the terminal's Ctrl-C then reaches it once, through us, and not twice.
        process_group=0,
        pass_fds=[pipe],
        env={**os.environ, LIFELINE: str(pipe)},
        **streams,
    )


@functools.cache
def _lifeline() -> int:
    """Return the end of a pipe that stays empty; the other end is held until this process is gone."""
    return os.pipe()[0]


def follow() -> None:
    """End this verb as by Ctrl-C when the process that runs it as a stage is gone.

    Does nothing in a verb that is no stage.
    """
    pipe = os.environ.pop(LIFELINE, None)
    if pipe is None:
        return
    # Processes that this verb starts have a pipe of their own, or none.
    os.set_inheritable(int(pipe), False)
    # A shell's background job and all below it ignore Ctrl-C; a stage hears it from its parent alone.
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Thread(target=_end_with_parent, args=(int(pipe),), daemon=True, name="lifeline").start()


def _end_with_parent(pipe: int) -> None:
    os.read(pipe, 1)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(PATIENCE)
    os.kill(os.getpid(), signal.SIGTERM)


def stop(process: subprocess.Popen) -> None:
    """Interrupt a verb and wait until it has closed its files, for `PATIENCE` or until a second Ctrl-C."""
    if process.poll() is not None:
        return
    process.send_signal(signal.SIGINT)
    try:
        process.wait(PATIENCE)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        process.terminate()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Background:
    """A verb that runs in the background and writes to a log file; stopped at the end of a ``with`` block."""

    def __init__(self, arguments: list[str], log: Path, yielding: bool = False) -> None:
        """Prepare.

        Args:
            arguments: Command line behind ``tacdata``.
            log: File that it writes to.
            yielding: Whether it leaves the processor to others that want it.
        """
        self.arguments, self.log, self._yielding = arguments, log, yielding

    def __enter__(self) -> Background:
        """Start it."""
        print(f"$ {written(self.arguments)} &", flush=True)
        with self.log.open("wb") as stream:
            self.process = _start(command_line(self.arguments), stdout=stream, stderr=stream)
        if self._yielding:
            # Gone already: then `follow` or `wait_until` reports the reason.
            with suppress(ProcessLookupError):
                niceness = max(_YIELDING, os.getpriority(os.PRIO_PROCESS, 0))
                os.setpriority(os.PRIO_PROCESS, self.process.pid, niceness)
        return self

    def follow(self) -> int:
        """Show the last line of its log and all that comes, until it ends; return its exit code."""
        with self.log.open(errors="replace") as stream:
            output = stream.read()
            # Of a verb that has ended more is shown: its error is among the last lines.
            for line in output.rstrip().splitlines()[-1 if self.process.poll() is None else -_TAIL :]:
                print(line, flush=True)
            while True:
                code = self.process.poll()
                if output := stream.read():
                    print(output, end="", flush=True)
                if code is not None:
                    return code
                time.sleep(0.05)

    def wait_until(self, ready: Callable[[], bool], what: str, timeout: float) -> None:
        """Wait until ``ready()``, at most ``timeout`` [s]; ``what`` describes it.

        Raises:
            DeviceError: If the verb ends first, or the time is over.
        """
        deadline = time.monotonic() + timeout
        while not ready():
            if (code := self.process.poll()) is not None or time.monotonic() > deadline:
                tail = self.log.read_text(errors="replace").strip().splitlines()[-5:]
                state = f"is not ready after {timeout:g} s" if code is None else f"ended with exit code {code}"
                raise DeviceError(
                    f"{written(self.arguments)} {state}" + "".join(f"\n    {line}" for line in tail),
                    what,
                    f"read {self.log}",
                )
            time.sleep(0.05)

    def __exit__(self, *exception: object) -> None:
        """Stop it."""
        stop(self.process)


def clock_face(seconds: float) -> str:
    """Return a duration [s] as minutes:seconds."""
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
