"""Streams of a demonstration: one that is silent, or cannot be right, is reported and does not stop the others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tacdata.devices.device import Camera, TaxelBoard, TaxelFrame
from tacdata.errors import TacdataError
from tacdata.recording.check.channel_health import reading_limits
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.files.writer import EpisodeWriter
from tacdata.recording.live.detection_process import Detect
from tacdata.recording.live.device_streams import DeviceStreams
from tacdata.recording.live.reading_health import ReadingHealth

AGAIN_NS = 60_000_000_000
"""Impossible readings are reported again after this time [ns of the host's clock]."""


class DemoStreams(DeviceStreams):
    """A context that writes incoming messages to the open recording."""

    silence = 1.5

    def __init__(
        self,
        boards: dict[str, TaxelBoard],
        cameras: dict[str, Camera],
        entries: dict[str, dict[str, Any]],
        fingers: dict[str, Any],
        detect: Detect | None,
        say: Callable[[str], None],
        latencies: dict[str, StreamLatency] | None = None,
    ) -> None:
        """Prepare the threads.

        Args:
            boards: The opened boards, by finger.
            cameras: The opened cameras.
            entries: The rig file's camera entries.
            fingers: The fingers' document.
            detect: Searches an image for the cubes; without it images are only stored.
            say: Called when a stream falls silent or delivers again.
            latencies: Constant latency of each stream, where it is known.
        """
        super().__init__(boards, cameras, entries, fingers, detect)
        self._say = say
        self._why: dict[str, str] = {}
        self._lost: dict[str, str] = {}
        self._heard: set[str] = set()
        self._health = {name: _health_of(board) for name, board in self._boards.items()}
        self._quiet_until_ns = dict.fromkeys(self._boards, 0)
        self.set_latencies(latencies or {})

    def __enter__(self) -> DemoStreams:
        """Start the threads."""
        super().__enter__()
        return self

    @property
    def silent(self) -> dict[str, str]:
        """Stream -> why it delivers nothing at the moment, as a sentence."""
        return dict(self._why)

    @property
    def lost_cameras(self) -> dict[str, str]:
        """Camera that delivers nothing any more -> why, as a sentence."""
        return dict(self._lost)

    @property
    def heard(self) -> frozenset[str]:
        """The streams that have delivered anything since the start."""
        return frozenset(self._heard)

    def record_into(self, sink: EpisodeWriter | None) -> None:
        """Send all arrivals from now on to a recording, or to none."""
        super().record_into(sink)
        # A recording that begins during a silence holds its reason, too.
        for name, why in self.silent.items():
            if sink:
                sink.note(f"{name}: {why}", "error")

    def _delivered(self, name: str, count: int) -> None:
        self._heard.add(name)
        if self._why.pop(name, None):
            self._tell(f"{name} speaks again", "warning")

    def _read(self, stream: str, frames: list[TaxelFrame]) -> None:
        for frame in frames:
            words = self._health[stream].take(frame.arrival_ns, frame.counts)
            if not words:
                continue
            # Restarted, so that a fault that lasts is found again.
            self._health[stream] = _health_of(self._boards[stream])
            if frame.arrival_ns >= self._quiet_until_ns[stream]:
                self._quiet_until_ns[stream] = frame.arrival_ns + AGAIN_NS
                self._tell(f"{stream}: {words}; check its supply, cable and firmware", "error")

    def _silent(self, name: str) -> None:
        if name not in self._why:
            if self._hangs(name):
                self._lost[name] = f"{name} repeats one image: it hangs"
            self._fall_silent(name, f"{self._what(name)} for {self.silence:g} s; check cable and power")

    def _broken(self, name: str, error: TacdataError) -> None:
        if name in self._cameras:
            self._lost[name] = error.given
        self._fall_silent(name, f"{error.given}; {error.remedy}")

    def _fall_silent(self, name: str, why: str) -> None:
        self._why[name] = why
        self._tell(why if why.startswith(name) else f"{name}: {why}", "error")

    def _tell(self, words: str, level: str) -> None:
        self._say(words)
        with self._lock:
            if self._sink:
                self._sink.note(words, level)


def _health_of(board: TaxelBoard) -> ReadingHealth:
    described = board.describe()
    return ReadingHealth(reading_limits(described), described.get("rate", {}).get("nominal"), board.clock.rate)
