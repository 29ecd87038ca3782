"""Threads that read boards and cameras and write to the open recording."""

from __future__ import annotations

import copy
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from tacdata.devices.device import Camera, Device, ImageFrame, StreamCounts, TaxelBoard, TaxelFrame
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.clocks.clock_model import ClockModel, StreamLatency
from tacdata.recording.clocks.polled_clock import PolledClock
from tacdata.recording.clocks.running_clock import StreamClock, nominal_period_ns
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.camera_stream import CameraStream
from tacdata.recording.live.detection_process import Detect
from tacdata.recording.live.live_feed import LiveFeed, Watch
from tacdata.wire.patience import Lateness, Patience, while_late

BOARD = "taxel board"
"""Name of a single board in messages."""
POLL = 0.05
"""Timeout of one read [s of the host's clock]."""
CATCH_UP = 5.0
"""How long the end of a recording waits for unwritten images [s of real time]."""
SEARCH = 2.0
"""How long the end of a recording waits for a tag search [s of real time]."""


class DeviceStreams(ABC):
    """A context that runs while the devices are open; between recordings, arrivals feed only the clock models."""

    silence: float
    """Time without data after which a stream counts as silent [s of real time]."""

    def __init__(
        self,
        boards: dict[str, TaxelBoard],
        cameras: dict[str, Camera],
        entries: dict[str, dict[str, Any]],
        fingers: dict[str, Any] | None = None,
        detect: Detect | None = None,
        watch: Watch | None = None,
    ) -> None:
        """Prepare the threads.

        Args:
            boards: The opened boards; a single one may be called "".
            cameras: The opened cameras.
            entries: The rig file's camera entries.
            fingers: Fingers that cameras without a cube look for (`schemas/fingers.schema.json`).
            detect: Searches an image for cubes; without it images are only stored.
            watch: Called with a sample of the data.
        """
        self._boards = {f"taxels {name}".rstrip(): board for name, board in boards.items()}
        self._cameras = {f"camera {name}": camera for name, camera in cameras.items()}
        self._feed = LiveFeed(watch) if watch else None
        self._host = next(iter([*boards.values(), *cameras.values()])).clock.host
        self._stop, self._lock, self._ending = self._host.event(), self._host.lock(), False
        self._sink: EpisodeWriter | None = None
        self._before: dict[str, StreamCounts] = {}
        self._passes: dict[str, int] = {}
        self._clocks = {name: stream_clock(board) for name, board in self._boards.items()}
        self._clocks |= {name: StreamClock("order", camera.clock.rate) for name, camera in self._cameras.items()}
        self._views = [CameraStream(name, entries.get(name, {}), detect, fingers) for name in cameras]
        self._work: dict[str, Callable[[], int]] = {}
        self._devices: dict[str, Device] = dict(self._cameras)
        for name, stream in zip(boards, self._boards, strict=True):
            self._work[stream if name else BOARD] = self._board_reader(stream, name)
            self._devices[stream if name else BOARD] = boards[name]
        for view in self._views:
            self._work[f"camera {view.name}"] = self._camera_reader(view)
        self._readers: dict[str, Lateness] = {}
        self._threads: list[threading.Thread] = []

    def _what(self, name: str) -> str:
        """Describe what a silent stream delivers."""
        return "the same image again and again" if self._hangs(name) else "nothing received"

    def _hangs(self, name: str) -> bool:
        """Return whether a camera repeats one image."""
        return any(view.is_frozen for view in self._views if name == f"camera {view.name}")

    def _busy(self, name: str) -> str:
        """Name this computer's own lateness in a stream's silence, as part of a sentence; empty if it was in time."""
        return while_late(self._late(name))

    def _late(self, name: str) -> float:
        """Return the lateness in taking a stream's data [s of real time]."""
        device = self._devices.get(name)
        own = self._readers[name].seconds if name in self._readers else 0.0
        return max(own, device.late if device else 0.0)

    def _waiting(self, name: str) -> float:
        """Return the lateness that extends a stream's timeout [s of real time]."""
        device = self._devices[name]
        # An emulated device runs on this computer: any lateness counts.
        return self._late(name) if device.clock.rate > 1.0 else device.late

    def _silence_of(self, name: str) -> float:
        """Time without data after which a stream counts as silent [s of real time]."""
        return self.silence

    @abstractmethod
    def _silent(self, name: str) -> None:
        """Called when a stream has delivered nothing for `silence`, and with each empty read after that; may raise."""

    @abstractmethod
    def _broken(self, name: str, error: TacdataError) -> None:
        """Called with the error that ended a stream's thread."""

    @abstractmethod
    def _delivered(self, name: str, count: int) -> None:
        """Called when a stream has delivered ``count`` frames, images or reports."""

    def _read(self, stream: str, frames: list[TaxelFrame]) -> None:  # noqa: B027 - most have no opinion
        """Look at the frames of a board, which are stored already; may raise."""

    def __enter__(self) -> DeviceStreams:
        """Start the threads."""
        self._threads = [self._host.thread(self._run, name, (name, read)) for name, read in self._work.items()]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop the threads; the devices must still be open."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=10.0)

    @property
    def searching(self) -> bool:
        """Whether every camera's detector has loaded and answered once."""
        return all(view.ready for view in self._views)

    @property
    def clock_models(self) -> dict[str, ClockModel | PolledClock]:
        """Clock of each stream, by its name: "taxels" or "taxels NAME", "camera NAME"."""
        with self._lock:
            models = {name: clock.model() for name, clock in self._clocks.items()}
        return {name: model for name, model in models.items() if model is not None}

    @property
    def counts(self) -> dict[str, StreamCounts]:
        """Counts of each stream's data since the last call of `record_into`."""
        return {name: _since(self._before.get(name, StreamCounts()), totals) for name, totals in self._totals().items()}

    def record_into(self, sink: EpisodeWriter | None) -> None:
        """Send all arrivals from now on to a recording, or to none."""
        with self._lock:
            self._sink = sink
            self._before = copy.deepcopy(self._totals())
            for name in self._cameras:
                self._before[name].notes.clear()  # settings that a camera refused at opening concern every recording

    def set_latencies(self, latencies: dict[str, StreamLatency]) -> None:
        """Subtract these constant latencies, by stream name, from all sample times from now on, and no others."""
        with self._lock:
            for name, clock in self._clocks.items():
                clock.set_latency(latencies.get(name))

    def catch_up(self, patience: float = CATCH_UP) -> None:
        """Wait at most ``patience`` [s of real time] until every stream has handed on its arrivals."""
        end, self._ending = self._host.monotonic() + patience, True
        begun = dict(self._passes)
        for thread in self._threads:
            # One pass may have been under way; the one after it began later than this call and has ended.
            while self._passes.get(thread.name, 0) < begun.get(thread.name, 0) + 2:
                if not thread.is_alive() or self._host.monotonic() > end:
                    break
                self._host.sleep(POLL / 10)
        self._ending = False

    def _totals(self) -> dict[str, StreamCounts]:
        return {name: device.counts for name, device in (self._boards | self._cameras).items()}

    def _run(self, name: str, read: Callable[[], int]) -> None:
        # A look comes each `POLL`, and later on a computer that is far too busy: that is no silence of the device.
        patience = Patience(self._silence_of(name), step=2 * POLL, host=self._host)
        reader = self._readers[name] = Lateness(2 * POLL, self._host)
        while not self._stop.is_set():
            reader.look()
            self._passes[name] = self._passes.get(name, 0) + 1
            try:
                if count := read():
                    patience.restart()
                    reader.restart()
                    self._delivered(name, count)
                elif patience.over(self._waiting(name)):
                    self._silent(name)
            except TacdataError as error:
                return self._broken(name, error)
            except Exception as error:  # a bug in a driver must be noticed, but must not cost the other streams
                what = f"{name}: {type(error).__name__}: {error}"
                return self._broken(name, DeviceError(what, "a driver that works", "report it with this line"))

    def _board_reader(self, stream: str, name: str) -> Callable[[], int]:
        board = self._boards[stream]

        def read() -> int:
            frames = board.read(POLL)
            with self._lock:
                clock = self._clocks[stream]
                for frame in frames:
                    counter = frame.device_ns if clock.axis == "device_ns" else frame.counter
                    sample_ns = clock.take(frame.arrival_ns, counter)
                    # Frames that waited in a buffer since the press before belong to that one.
                    if self._sink and frame.arrival_ns >= self._sink.begun_ns:
                        self._sink.taxels(frame, sample_ns, name)
                if self._feed and frames:
                    self._feed.taxels(frames[-1].arrival_ns, frames[-1].counts)
            self._read(stream, frames)
            return len(frames)

        return read

    def _camera_reader(self, view: CameraStream) -> Callable[[], int]:
        stream = f"camera {view.name}"
        camera = self._cameras[stream]

        def read() -> int:
            frames = camera.read(POLL)
            for frame in frames:
                with self._lock:
                    sink, clock = self._sink, self._camera_clock(stream, frame)
                    counter = frame.device_ns if clock.axis == "device_ns" else frame.sequence
                    sample_ns = clock.take(frame.arrival_ns, counter)
                if sink is None or frame.arrival_ns >= sink.begun_ns:
                    view.take(frame, sample_ns, sink)
                if self._feed:
                    self._feed.image(view.name, frame.arrival_ns, frame.image)
            view.collect(SEARCH if self._ending else 0.0)
            return sum(view.is_new(frame) for frame in frames)

        return read

    def _camera_clock(self, name: str, frame: ImageFrame) -> StreamClock:
        """Return a camera's clock; its first image shows whether the camera gives a time of its own."""
        clock = self._clocks[name]
        if clock.axis == "order" and clock.frames == 0 and frame.device_ns >= 0:
            latency, clock = clock.latency, StreamClock("device_ns", clock.rate)
            clock.set_latency(latency)
            self._clocks[name] = clock
        return clock


def stream_clock(board: TaxelBoard) -> StreamClock:
    """Return a clock for a board's frames."""
    described = board.describe()
    axis = "device_ns" if described.get("clock") == "device_ns" else "counter"
    return StreamClock(axis, board.clock.rate, nominal_period_ns(described))


def _since(earlier: StreamCounts, later: StreamCounts) -> StreamCounts:
    numbers = {k: v - getattr(earlier, k) for k, v in vars(later).items() if isinstance(v, int)}
    return StreamCounts(**numbers, notes=later.notes[len(earlier.notes) :])
