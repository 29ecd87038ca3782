"""Threads that drain the devices into whichever recording is open."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from tacdata.devices.device import Camera, StreamCounts
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.camera_stream import CameraStream
from tacdata.recording.clock_model import ClockModel, EnvelopeFit
from tacdata.recording.detection_process import Detect
from tacdata.recording.rig_devices import RigDevices
from tacdata.recording.writer import EpisodeWriter

SILENCE = 3.0
"""A stream that delivers nothing for so long is a fault [s of real time]."""
POLL = 0.05
"""How often reports are fetched [s of real time], and how long a read may wait [s of the host's clock]."""
CATCH_UP = 5.0
"""How long the end of a recording waits for images not yet written [s of real time]."""
SEARCH = 2.0
"""How long the end of a recording waits for a search for tags that is under way [s of real time]."""
REFIT = 16
"""Frames between two refits of the clock model while recording; the final one uses all."""


class Streams:
    """Runs while the session runs; what arrives between recordings feeds the clock models only."""

    def __init__(
        self,
        devices: RigDevices,
        cameras: dict[str, dict[str, Any]],
        on_fault: Callable[[], None],
        detect: Detect | None = None,
    ) -> None:
        """Prepare the threads.

        Args:
            devices: The opened devices.
            cameras: The rig file's camera entries.
            on_fault: Called at once, in the faulty stream's thread, before anything else: stops the motion.
            detect: Searches an image for the cube; without it images are only stored.
        """
        self._devices, self._on_fault = devices, on_fault
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._sink: EpisodeWriter | None = None
        self._fault: TacdataError | None = None
        self._fit = EnvelopeFit()
        self._model: ClockModel | None = None
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
            self._cameras.append(CameraStream(name, cameras.get(name, {}), detect))
            work.append((f"camera {name}", self._camera_reader(camera, self._cameras[-1])))
        self._threads = [
            threading.Thread(target=self._run, args=(name, read), name=name, daemon=True)
            for name, read in work
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
            self._fail(
                DeviceError(f"writing failed: {failure}", "a disk with room", "make room, then --resume")
            )
        return self._fault

    @property
    def searching(self) -> bool:
        """Whether every camera's detector has loaded its libraries and answered once."""
        return all(stream.ready for stream in self._cameras)

    def record_into(self, sink: EpisodeWriter | None) -> None:
        """Send everything that arrives from now on into a recording, or nowhere."""
        with self._lock:
            self._sink = sink

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
    def clock_models(self) -> dict[str, ClockModel]:
        """Clock model of each stream that has a counter."""
        with self._lock:
            model = self._fit.model()
        return {} if model is None else {"taxels": model}

    @property
    def counts(self) -> dict[str, StreamCounts]:
        """What each stream has delivered since the session's start."""
        return {"taxels": self._devices.board.counts}

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
            for frame in frames:
                self._fit.add(frame.arrival_ns, frame.counter)
                if self.frames % REFIT == 0 or self._model is None:
                    self._model = self._fit.model()
                self.frames += 1
                sample = frame.arrival_ns
                if self._model is not None and frame.counter >= 0:
                    sample = min(self._model.sample_of(frame.counter), sample)
                if self._sink and frame.arrival_ns >= self._sink.begun_ns:
                    self._sink.taxels(frame, sample)
        return bool(frames)

    def _read_status(self) -> bool:
        statuses = self._devices.cnc.statuses()
        with self._lock:
            for status in statuses:
                x, y, z = status.position.tolist()
                self.position = (x, y, z)
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
                if sink is None or frame.arrival_ns >= sink.begun_ns:
                    stream.take(frame, sink)
            stream.collect(SEARCH if self._ending else 0.0)
            return bool(frames)

        return read
