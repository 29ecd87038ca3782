"""Threads that drain boards and cameras into a demonstration; a stream that ends never costs the others."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from tacdata.devices.device import Camera, StreamCounts, TaxelBoard
from tacdata.errors import TacdataError
from tacdata.recording.camera_stream import CameraStream
from tacdata.recording.clock_model import ClockModel, Latency
from tacdata.recording.detection_process import Detect
from tacdata.recording.stream_clock import StreamClock, nominal_period_ns
from tacdata.recording.writer import EpisodeWriter

SILENCE = 1.5
"""A stream that delivers nothing for so long is said to be silent [s of real time]."""
POLL = 0.05
"""How long a read may wait [s of the host's clock]."""
SEARCH = 2.0
"""How long the end of a recording waits for a search for tags that is under way [s of real time]."""


class DemoStreams:
    """Runs as a context; what arrives goes into the open recording."""

    def __init__(
        self, boards: dict[str, TaxelBoard], cameras: dict[str, Camera], entries: dict[str, dict[str, Any]],
        fingers: dict[str, Any], detect: Detect | None, say: Callable[[str], None],
        latencies: dict[str, Latency] | None = None,
    ) -> None:  # fmt: skip
        """Prepare the threads.

        Args:
            boards: The opened boards, by finger.
            cameras: The opened cameras.
            entries: The rig file's camera entries.
            fingers: The fingers' document.
            detect: Searches an image for the cubes; without it images are only stored.
            say: Is told when a stream falls silent or speaks again.
            latencies: Constant delay of each stream, where it is known.
        """
        self._boards, self._cameras, self._say = boards, cameras, say
        self._stop, self._lock = threading.Event(), threading.Lock()
        self._sink: EpisodeWriter | None = None
        self._silent: dict[str, str] = {}
        self._heard: dict[str, float] = {}
        self._ending = False
        self._clocks: dict[str, StreamClock] = {}
        for name, board in boards.items():
            described = board.describe()
            axis = "device_ns" if described.get("clock") == "device_ns" else "counter"
            self._clocks[f"taxels {name}"] = StreamClock(axis, board.clock.rate, nominal_period_ns(described))
        self._views = {name: CameraStream(name, entries[name], detect, fingers) for name in cameras}
        self._clocks |= {f"camera {name}": StreamClock("order", camera.clock.rate) for name, camera in cameras.items()}
        for name, latency in (latencies or {}).items():
            self._clocks[name].set_latency(latency)
        work: dict[str, Callable[[], int]] = {f"taxels {n}": self._board_reader(n) for n in boards}
        work |= {f"camera {name}": self._camera_reader(name) for name in cameras}
        self._threads = [
            threading.Thread(target=self._run, args=item, name=item[0], daemon=True) for item in work.items()
        ]

    def __enter__(self) -> DemoStreams:
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
    def searching(self) -> bool:
        """Whether every camera's detector has loaded its libraries and answered once."""
        return all(view.ready for view in self._views.values())

    @property
    def silent(self) -> dict[str, str]:
        """Stream -> why nothing comes from it at the moment, in words."""
        return dict(self._silent)

    @property
    def heard(self) -> frozenset[str]:
        """The streams from which anything has come since the start."""
        return frozenset(self._heard)

    @property
    def counts(self) -> dict[str, StreamCounts]:
        """What each stream has delivered since the start."""
        cameras = {f"camera {name}": camera.counts for name, camera in self._cameras.items()}
        return {**{f"taxels {name}": board.counts for name, board in self._boards.items()}, **cameras}

    @property
    def clock_models(self) -> dict[str, ClockModel]:
        """Clock of each stream, by its name: "taxels FINGER", "camera NAME"."""
        with self._lock:
            models = {name: clock.model() for name, clock in self._clocks.items()}
        return {name: model for name, model in models.items() if model is not None}

    def record_into(self, sink: EpisodeWriter | None) -> None:
        """Send everything that arrives from now on into a recording, or nowhere."""
        if sink is None:
            self._ending = True
            time.sleep(4 * POLL)
            self._ending = False
        with self._lock:
            self._sink = sink
        for name, why in self._silent.items():
            if sink:
                sink.note(f"{name}: {why}", "error")

    def _run(self, name: str, read: Callable[[], int]) -> None:
        last, broken = time.monotonic(), False
        while not self._stop.is_set():
            try:
                got = 0 if broken else read()
            except TacdataError as error:
                broken = True
                self._fall_silent(name, error.given)
                continue
            except Exception as error:  # a driver's bug must not cost the other streams
                broken = True
                self._fall_silent(name, f"{type(error).__name__}: {error}")
                continue
            if got:
                last = self._heard[name] = time.monotonic()
                if self._silent.pop(name, None):
                    self._tell(f"{name} speaks again", "warning")
            elif broken:
                self._stop.wait(POLL)
            elif time.monotonic() - last > SILENCE and name not in self._silent:
                self._fall_silent(name, f"nothing received for {SILENCE:g} s; check cable and power")

    def _fall_silent(self, name: str, why: str) -> None:
        self._silent[name] = why
        self._tell(f"{name}: {why}", "error")

    def _tell(self, words: str, level: str) -> None:
        self._say(words)
        with self._lock:
            if self._sink:
                self._sink.note(words, level)

    def _board_reader(self, name: str) -> Callable[[], int]:
        board, key = self._boards[name], f"taxels {name}"

        def read() -> int:
            frames = board.read(POLL)
            with self._lock:
                clock = self._clocks[key]
                for frame in frames:
                    counter = frame.device_ns if clock.axis == "device_ns" else frame.counter
                    sample = clock.take(frame.arrival_ns, counter)
                    if self._sink and frame.arrival_ns >= self._sink.begun_ns:
                        self._sink.taxels(frame, sample, name)
            return len(frames)

        return read

    def _camera_reader(self, name: str) -> Callable[[], int]:
        camera, key, view = self._cameras[name], f"camera {name}", self._views[name]

        def read() -> int:
            frames = camera.read(POLL)
            for frame in frames:
                with self._lock:
                    sink, clock = self._sink, self._clocks[key]
                    if clock.axis == "order" and clock.frames == 0 and frame.device_ns >= 0:
                        latency, clock = clock.latency, StreamClock("device_ns", clock.rate)
                        clock.set_latency(latency)
                        self._clocks[key] = clock
                    counter = frame.device_ns if clock.axis == "device_ns" else frame.sequence
                    sample = clock.take(frame.arrival_ns, counter)
                if sink is None or frame.arrival_ns >= sink.begun_ns:
                    view.take(frame, sample, sink)
            view.collect(SEARCH if self._ending else 0.0)
            return len(frames)

        return read
