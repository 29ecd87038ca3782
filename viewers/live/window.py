"""A live view of a recording in progress, in a process of its own. It drops frames that it cannot show in time."""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from queue import Empty, Full
from typing import Any

import numpy as np

from tacdata.errors import UsageError
from tacdata.viewers.live.fed_viewer import START, fed_viewer
from tacdata.viewers.rerun.window import require_display

WAITING = 16
"""Values that wait for the viewer; more are dropped [count]."""
PATIENCE = 15.0
"""How long the viewer may take to end [s of real time]."""
NICENESS = 10
"""By how much the process gives way to others (Unix)."""

Watch = Callable[[str, int, Any], None]


@contextmanager
def live_view(where: str, columns: int, rows: int) -> Iterator[Watch]:
    """Show a recording while it is made.

    Args:
        where: ``window``, ``web`` (an address on this machine is printed), or the path of a Rerun file to write.
        columns: Taxels along x.
        rows: Taxels along y.

    Yields:
        ``watch(stream, arrival [ns], value)``, which never waits (`tacdata.recording.live.live_feed`).

    Raises:
        UsageError: If there is no display for a window, the file exists, or Rerun does not start.
    """
    _refuse(where)
    # A fork would copy the locks of the recorder's threads as they are at that moment.
    context = get_context("spawn")
    values, started, ending = context.Queue(WAITING), context.Queue(), context.Event()
    process = context.Process(target=_show, args=(where, columns, rows, values, started, ending), daemon=False)
    process.start()
    try:
        try:
            reply = started.get(timeout=START)
        except Empty:
            reply = "error: the viewer did not start"
        if reply.startswith("error: "):
            raise UsageError(reply.removeprefix("error: "), "window, web or FILE.rrd", "name another, or leave it out")
        if reply:
            print(f"live view: {reply}", flush=True)

        def watch(stream: str, arrival_ns: int, value: Any) -> None:
            with suppress(Full):
                values.put_nowait((stream, arrival_ns, value))

        yield watch
    finally:
        with suppress(Full):
            values.put(None, timeout=PATIENCE)  # after everything in the queue
        ending.set()
        # First by itself, then asked, then forced: a viewer that hangs must not hold the recorder.
        for end in (lambda: None, process.terminate, process.kill):
            if process.is_alive():
                end()
                process.join(PATIENCE)
        # Otherwise this process would wait at its end for values that nobody takes.
        values.cancel_join_thread()
        values.close()


def _refuse(where: str) -> None:
    if where == "window":
        require_display("name web, or a file that ends in .rrd, in place of window")
    elif where != "web":
        path = Path(where)
        if path.suffix != ".rrd":
            raise UsageError(f"--live {where}", "window, web, or a file name that ends in .rrd", "correct --live")
        if path.exists():
            raise UsageError(f"{path} exists", "a new file; nothing is overwritten", "choose another name")


def _show(where: str, columns: int, rows: int, values: Any, started: Any, ending: Any) -> None:
    # Ctrl-C reaches every process of the terminal; only the recorder is to answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    with ExitStack() as stack:
        try:
            recording, words = _open(where, stack)
        except Exception as error:  # Rerun's messages are for the person who asked for it
            started.put(f"error: the live view cannot be opened ({type(error).__name__}: {error})")
            return
        started.put(words)
        drawing = _Drawing(recording, columns, rows)
        while True:
            try:
                value = values.get(timeout=PATIENCE / 2)
            except Empty:
                if ending.is_set():
                    break
                continue
            if value is None:
                break
            drawing.take(*value)
        recording.flush()
        recording.disconnect()
        # Rerun reports on the terminal that its server goes away, which it does because we end it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _open(where: str, stack: ExitStack) -> tuple[Any, str]:
    import rerun as rr

    recording = rr.RecordingStream("tacdata_live")
    if where not in ("window", "web"):
        recording.save(where)
        return recording, where
    viewer = stack.enter_context(fed_viewer(where == "web"))
    viewer.connect(recording)
    return recording, viewer.address


class _Drawing:
    """Writes arriving data into a Rerun recording: the array as a picture, signals, the guide, images."""

    def __init__(self, recording: Any, columns: int, rows: int) -> None:
        self._recording, self._shape = recording, (rows, columns)
        self._first: np.ndarray | None = None

    def take(self, stream: str, arrival_ns: int, value: Any) -> None:
        import rerun as rr

        self._recording.set_time("host_time", timestamp=np.datetime64(arrival_ns, "ns"))
        kind, _, name = stream.partition(" ")
        if kind == "taxels":
            self._taxels(np.asarray(value, float))
        elif kind == "cnc":
            for axis, number in zip("xyz", value, strict=True):
                self._recording.log(f"guide/{axis}_mm", rr.Scalars([float(number)]))
        elif kind == "depth":
            self._depth(name, *value)
        elif kind == "camera":
            self._recording.log(f"camera/{name}", rr.Image(value, "L" if value.ndim == 2 else "BGR"))

    def _depth(self, name: str, depth: np.ndarray, largest: float, centre: tuple[float, float] | None) -> None:
        import rerun as rr

        # Row 0 of a map is at the lowest x; shown with x to the right and y upwards, as the array is.
        self._recording.log(f"depth/{name}", rr.Tensor(np.round(depth.T[::-1], 4), dim_names=("y", "x")))
        self._recording.log(f"depth_mm/{name}", rr.Scalars([largest]))
        for axis, number in zip("xy", centre or (np.nan, np.nan), strict=True):
            self._recording.log(f"centre_mm/{name}/{axis}", rr.Scalars([float(number)]))

    def _taxels(self, counts: np.ndarray) -> None:
        import rerun as rr

        if self._first is None:
            self._first = counts
        change = counts - self._first
        self._recording.log("taxels/change_counts", rr.Scalars(change))
        if change.size == self._shape[0] * self._shape[1]:
            # Row 0 of the array is at the lowest y, row 0 of a picture on top.
            self._recording.log("array", rr.Tensor(change.reshape(self._shape)[::-1], dim_names=("y", "x")))
