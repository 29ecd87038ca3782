"""Threads that drain the devices into whichever recording is open."""

from __future__ import annotations

import copy
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from tacdata.devices.device import Camera, ImageFrame, StreamCounts
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.camera_stream import CameraStream
from tacdata.recording.clock_model import ClockModel, Latency
from tacdata.recording.detection_process import Detect
from tacdata.recording.live_feed import LiveFeed, Watch
from tacdata.recording.polled_clock import PolledClock, polled_clock
from tacdata.recording.rig_devices import RigDevices
from tacdata.recording.stream_clock import StreamClock, nominal_period_ns
from tacdata.recording.writer import EpisodeWriter

SILENCE = 3.0
"""A stream that delivers nothing for so long is a fault [s of real time]."""
POLL = 0.05
"""How often reports are fetched [s of real time], and how long a read may wait [s of the host's clock]."""
CATCH_UP = 5.0
"""How long the end of a recording waits for images not yet written [s of real time]."""
SEARCH = 2.0
"""How long the end of a recording waits for a search for tags that is under way [s of real time]."""
TRIPS = 4096
"""Round trips of the controller's reports that are remembered for its clock [count]."""


class Streams:
    """Runs while the session runs; what arrives between recordings feeds the clock models only."""

    def __init__(
        self,
        devices: RigDevices,
        cameras: dict[str, dict[str, Any]],
        on_fault: Callable[[], None],
        detect: Detect | None = None,
        watch: Watch | None = None,
        fingers: dict[str, Any] | None = None,
    ) -> None:
        """Prepare the threads.

        Args:
            devices: The opened devices.
            cameras: The rig file's camera entries.
            on_fault: Called at once, in the faulty stream's thread, before anything else: stops the motion.
            detect: Searches an image for the cube; without it images are only stored.
            watch: Is shown some of what arrives.
            fingers: What cameras without a cube look for (`schemas/fingers.schema.json`).
        """
        self._devices, self._on_fault = devices, on_fault
        self._feed = LiveFeed(watch) if watch else None
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._sink: EpisodeWriter | None = None
        self._before: dict[str, StreamCounts] = {}
        self._fault: TacdataError | None = None
        board = devices.board.describe()
        axis = "device_ns" if board.get("clock") == "device_ns" else "counter"
        self._clocks = {"taxels": StreamClock(axis, devices.board.clock.rate, nominal_period_ns(board))}
        self._clocks |= {
            f"camera {name}": StreamClock("order", camera.clock.rate) for name, camera in devices.cameras.items()
        }
        self._trips: deque[tuple[int, int]] = deque(maxlen=TRIPS)
        self._passes: dict[str, int] = {}
        self._ending = False
        self.frames = 0
        """Taxel frames received since the start."""
        self.position: tuple[float, float, float] | None = None
        """Latest reported machine position [mm]."""
        work: list[tuple[str, Callable[[], bool]]] = [
            ("taxel board", self._read_board),
            ("motion controller", self._read_status),
        ]
        self._cameras: list[CameraStream] = []
        for name, camera in devices.cameras.items():
            self._cameras.append(CameraStream(name, cameras.get(name, {}), detect, fingers))
            work.append((f"camera {name}", self._camera_reader(camera, self._cameras[-1])))
        self._threads = [
            threading.Thread(target=self._run, args=(name, read), name=name, daemon=True) for name, read in work
        ]

    def __enter__(self) -> Streams:
        """Start the threads."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        """Stop the threads; the devices must still be open."""
        self._stop.set()
        for thread in self._threads:
            thread.join(timeout=10.0)

    @property
    def fault(self) -> TacdataError | None:
        """The first thing that went wrong in a stream or in writing, or None."""
        failure = self._sink.failure if self._sink else None
        if self._fault is None and failure is not None:
            self._fail(DeviceError(f"writing failed: {failure}", "a disk with room", "make room, then --resume"))
        return self._fault

    @property
    def searching(self) -> bool:
        """Whether every camera's detector has loaded its libraries and answered once."""
        return all(stream.ready for stream in self._cameras)

    def record_into(self, sink: EpisodeWriter | None) -> None:
        """Send everything that arrives from now on into a recording, or nowhere."""
        with self._lock:
            self._sink = sink
            self._before = copy.deepcopy(self._totals())
            for name in self._devices.cameras:
                self._before[f"camera {name}"].notes.clear()  # what a camera did not take at opening holds for all

    def catch_up(self, patience: float = CATCH_UP) -> None:
        """Wait at most so long [s of real time] until every stream has handed on what has arrived by now."""
        self._ending = True
        self._pass_twice(time.monotonic() + patience)
        self._ending = False

    def _pass_twice(self, end: float) -> None:
        begun = dict(self._passes)
        for thread in self._threads:
            # One pass may have been under way; the one after it began later than this call and has ended.
            while self._passes.get(thread.name, 0) < begun.get(thread.name, 0) + 2:
                if not thread.is_alive() or time.monotonic() > end:
                    break
                time.sleep(POLL / 10)

    @property
    def clock_models(self) -> dict[str, ClockModel | PolledClock]:
        """Clock of each stream, by its name: "taxels", "camera NAME", "cnc"."""
        with self._lock:
            models: dict[str, Any] = {name: clock.model() for name, clock in self._clocks.items()}
            models["cnc"] = polled_clock(*np.array(self._trips, np.int64).reshape(-1, 2).T)
        return {name: model for name, model in models.items() if model is not None}

    def set_latencies(self, latencies: dict[str, Latency]) -> None:
        """Take these constant delays of streams, by name, into all sample times from now on, and no others."""
        with self._lock:
            for name, clock in self._clocks.items():
                clock.set_latency(latencies.get(name))

    @property
    def counts(self) -> dict[str, StreamCounts]:
        """What each stream has delivered since `record_into` was called last."""
        return {name: _since(self._before.get(name, StreamCounts()), now) for name, now in self._totals().items()}

    def _totals(self) -> dict[str, StreamCounts]:
        cameras = {f"camera {name}": camera.counts for name, camera in self._devices.cameras.items()}
        return {"taxels": self._devices.board.counts, **cameras}

    def _fail(self, error: TacdataError) -> None:
        if self._fault is None:
            self._on_fault()
            self._fault = error

    def _run(self, name: str, read: Callable[[], bool]) -> None:
        heard = time.monotonic()
        while not self._stop.is_set():
            self._passes[name] = self._passes.get(name, 0) + 1
            try:
                if read():
                    heard = time.monotonic()
                elif time.monotonic() - heard > SILENCE:
                    raise DeviceError(
                        f"{name}: nothing received for {SILENCE:g} s",
                        "a stream that goes on",
                        "check cable and power, then continue with --resume",
                    )
            except TacdataError as error:
                return self._fail(error)
            except Exception as error:  # a driver's bug must stop the motion too
                what = f"{name}: {type(error).__name__}: {error}"
                return self._fail(DeviceError(what, "a driver that works", "report it with this line"))

    def _read_board(self) -> bool:
        frames = self._devices.board.read(POLL)
        with self._lock:
            clock = self._clocks["taxels"]
            for frame in frames:
                self.frames += 1
                sample = clock.take(frame.arrival_ns, frame.device_ns if clock.axis == "device_ns" else frame.counter)
                if self._sink and frame.arrival_ns >= self._sink.begun_ns:
                    self._sink.taxels(frame, sample)
            if self._feed and frames:
                self._feed.taxels(frames[-1].arrival_ns, frames[-1].counts)
        return bool(frames)

    def _read_status(self) -> bool:
        statuses = self._devices.cnc.statuses()
        with self._lock:
            for status in statuses:
                x, y, z = status.position.tolist()
                self.position = (x, y, z)
                self._trips.append((status.sent_ns, status.arrival_ns))
                if self._feed:
                    self._feed.position(status.arrival_ns, self.position)
                if self._sink and status.arrival_ns >= self._sink.begun_ns:
                    self._sink.status(status)
        time.sleep(POLL)
        return bool(statuses)

    def _camera_reader(self, camera: Camera, stream: CameraStream) -> Callable[[], bool]:
        def read() -> bool:
            frames = camera.read(POLL)
            for frame in frames:
                with self._lock:
                    sink = self._sink
                    clock = self._camera_clock(f"camera {stream.name}", frame)
                    counter = frame.device_ns if clock.axis == "device_ns" else frame.sequence
                    sample_ns = clock.take(frame.arrival_ns, counter)
                if sink is None or frame.arrival_ns >= sink.begun_ns:
                    stream.take(frame, sample_ns, sink)
                if self._feed:
                    self._feed.image(stream.name, frame.arrival_ns, frame.image)
            stream.collect(SEARCH if self._ending else 0.0)
            return bool(frames)

        return read

    def _camera_clock(self, name: str, frame: ImageFrame) -> StreamClock:
        """Return a camera's clock; its first image says whether the camera has a time of its own."""
        clock = self._clocks[name]
        if clock.axis == "order" and clock.frames == 0 and frame.device_ns >= 0:
            latency, clock = clock.latency, StreamClock("device_ns", clock.rate)
            clock.set_latency(latency)
            self._clocks[name] = clock
        return clock


def _since(before: StreamCounts, now: StreamCounts) -> StreamCounts:
    numbers = {k: v - getattr(before, k) for k, v in vars(now).items() if isinstance(v, int)}
    return StreamCounts(**numbers, notes=now.notes[len(before.notes) :])
