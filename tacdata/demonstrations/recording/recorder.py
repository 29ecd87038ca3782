"""Records demonstrations: boards on fingers and cameras on their cubes; no machine moves anything."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tacdata.demonstrations.recording.rig import DemoRig
from tacdata.demonstrations.recording.session import DemoSession, refresh
from tacdata.demonstrations.recording.streams import DemoStreams
from tacdata.devices.device import Camera, TaxelBoard, create
from tacdata.errors import DeviceError, UsageError
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.detection_process import Detect
from tacdata.recording.live.rig_devices import require_channels

FIRST_FRAME = 5.0
"""Time allowed for the streams to begin [s of real time]."""
FIRST_SEARCH = 20.0
"""Time that the recording waits for the tag detector to load [s of real time]; then it starts without."""
WATCH = 0.05
"""Interval at which the recorder checks whether it should end [s of real time]."""


@dataclass(frozen=True)
class DemoHeader:
    """Documents that are attached to every demonstration."""

    rig: dict[str, Any]
    """The demo rig's document with everything in it."""
    boards: dict[str, dict[str, Any]]
    """Finger -> its board's description of itself."""
    task: str

    @property
    def attachments(self) -> dict[str, Any]:
        """Name of each attachment and its document."""
        return {"demo_rig.json": self.rig, "boards.json": self.boards, "task.json": {"task": self.task}}


class DemoRecorder:
    """One session of recording by hand.

    Example:
        ``with DemoRecorder(session).opened() as recorder: recorder.record(lambda: False, seconds=10.0)``
    """

    def __init__(
        self, session: DemoSession, rig: DemoRig, detect: Detect | None = None, say: Callable[[str], None] | None = None
    ) -> None:
        """Build the drivers; nothing is opened yet.

        Args:
            session: The folder for the recordings.
            rig: The rig as it is now; its ports may have changed since the folder was created.
            detect: Searches an image for the cubes; without it images are only stored.
            say: Called with messages for a person.
        """
        self.session, self.rig, self._detect, self._say = session, rig, detect, say or (lambda words: None)
        self._boards: dict[str, TaxelBoard] = {n: create(e, TaxelBoard, rig.clock) for n, e in rig.boards.items()}
        self._cameras: dict[str, Camera] = {n: create(e, Camera, rig.clock) for n, e in rig.cameras.items()}
        self._stack = ExitStack()
        self._streams: DemoStreams | None = None

    def __enter__(self) -> DemoRecorder:
        """Open boards and cameras and wait until all of them deliver.

        Raises:
            UsageError: If a board sends another number of channels than its finger's sensor has taxels.
            DeviceError: If one of them is missing or silent, naming the finger or the camera.
        """
        for name, board in self._boards.items():
            require_channels(board, self.rig.sensors[name], f"the board of {name}", "sensors in the demo rig")
        try:
            for kind, devices in (("board of", self._boards), ("camera", self._cameras)):
                for name, device in devices.items():
                    self._open(f"{kind} {name}", device)
            rig = self.rig
            streams = DemoStreams(
                self._boards,
                self._cameras,
                rig.cameras,
                rig.document["fingers"],
                self._detect,
                self._say,
                rig.latencies,
            )
            self._streams = self._stack.enter_context(streams)
            self._wait(self._streams)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *exception: object) -> None:
        """Close everything."""
        self._stack.close()

    def record(self, ended: Callable[[], bool], seconds: float | None = None) -> Path:
        """Record one demonstration until ``ended()``, or for ``seconds`` [s of the rig's clock].

        Raises:
            DeviceError: If writing fails, a camera is lost, or every stream is silent; the file so far is kept.
            KeyboardInterrupt: On Ctrl-C; the recording so far is kept as an interrupted recording.
        """
        if self._streams is None:
            raise UsageError("the recorder is not open", "a recorder inside a with statement", "open it first")
        described = {name: board.describe() for name, board in self._boards.items()}
        header = DemoHeader(self.rig.document, described, self.session.task)
        names = tuple(self._cameras), tuple(self.rig.fingers), tuple(self._boards)
        writer = EpisodeWriter(self.session.next, header, self.rig.clock, *names)
        self._streams.record_into(writer)
        begun, reason = self.rig.clock.now_ns(), "stopped by Ctrl-C"
        try:
            while not ended() and (seconds is None or self.rig.clock.now_ns() - begun < seconds * 1e9):
                if writer.failure is not None:
                    break  # closing reports the failed writes
                # A take without one of its cameras is not worth its time: it ends, with the part before kept.
                if lost := self._streams.lost_cameras:
                    reason = "; ".join(lost.values())
                    seconds_kept = (self.rig.clock.now_ns() - begun) * 1e-9
                    raise DeviceError(
                        f"{reason}, {seconds_kept:.1f} s after the beginning of {writer.path.name}",
                        "every camera of the demo rig until the end",
                        "check its cable and its supply, then record again",
                    )
                if len(self._streams.silent) == len(self._boards) + len(self._cameras):
                    reason = "; ".join(f"{k}: {v}" for k, v in self._streams.silent.items())
                    fault = f"every stream fell silent ({reason})"
                    raise DeviceError(fault, "a stream that goes on", "check the cables")
                time.sleep(WATCH)
            reason = ""
        finally:
            # Data that arrived before the end may still be on the way to the writer.
            self._streams.catch_up()
            counts = self._streams.counts
            self._streams.record_into(None)
            path = writer.close(not reason, reason, self._streams.clock_models, counts)
            self.session = refresh(self.session)
        return path

    def _open(self, what: str, device: TaxelBoard | Camera) -> None:
        try:
            self._stack.enter_context(device)
        except DeviceError as error:
            raise DeviceError(f"{what}: {error.given}", error.allowed, error.remedy) from None

    def _wait(self, streams: DemoStreams) -> None:
        requirements = {f"taxels {name}" for name in self._boards} | {f"camera {name}" for name in self._cameras}
        end = time.monotonic() + FIRST_FRAME
        while missing := requirements - streams.heard:
            if streams.silent or time.monotonic() > end:
                why = "; ".join(f"{name}: {streams.silent.get(name, 'nothing received')}" for name in sorted(missing))
                remedy = "check cable and power, then start again"
                raise DeviceError(why, "a signal from every finger and camera", remedy)
            time.sleep(WATCH)
        end = time.monotonic() + FIRST_SEARCH
        while not streams.searching and time.monotonic() < end:
            time.sleep(WATCH)
