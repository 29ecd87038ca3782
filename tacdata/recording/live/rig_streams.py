"""Threads that read a rig's devices and write to the open recording; a fault in any stops the motion."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from tacdata.devices.device import CncStatus, StreamCounts, TaxelFrame
from tacdata.errors import DeviceError, TacdataError
from tacdata.recording.check.channel_health import reading_limits
from tacdata.recording.clocks.clock_model import ClockModel
from tacdata.recording.clocks.polled_clock import PolledClock, polled_clock
from tacdata.recording.live.detection_process import Detect
from tacdata.recording.live.device_streams import BOARD, POLL, DeviceStreams
from tacdata.recording.live.live_feed import Watch
from tacdata.recording.live.reading_health import BadReadings, ReadingHealth
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.wire.patience import EMULATED

TRIPS = 4096
"""Round trips of status reports that are kept for the controller's clock [count]."""
BOARD_SILENCE, SILENT_FRAMES = 1.8, 5
"""Time without a frame after which a board counts as silent [s of real time], and in frames of a slow one."""
AGAIN_NS = 60_000_000_000
"""Bad readings that go on are reported again after this time [ns of the host's clock]."""
TOO_BUSY = "end other programs on this computer, then check cable and power, and start again"
CONTROLLER = "motion controller"
"""Name of the controller's stream in messages."""
TAXELS = "taxels"
"""Name of the only board's stream."""


class RigStreams(DeviceStreams):
    """Runs during a session; between recordings, arrivals feed only the clock models."""

    silence = 3.0

    def __init__(
        self,
        devices: RigDevices,
        cameras: dict[str, dict[str, Any]],
        on_fault: Callable[[], None],
        detect: Detect | None = None,
        watch: Watch | None = None,
        fingers: dict[str, Any] | None = None,
        off_path: Callable[[CncStatus], TacdataError | None] = lambda status: None,
        on_bad_readings: Callable[[str], None] | None = None,
    ) -> None:
        """Prepare the threads.

        Args:
            devices: The opened devices.
            cameras: The rig file's camera entries.
            on_fault: Called first, in the faulty stream's thread: stops the motion.
            detect: Searches an image for the cube; without it images are only stored.
            watch: Called with a sample of the data.
            fingers: Fingers that cameras without a cube look for (`schemas/fingers.schema.json`).
            on_bad_readings: Called with words when the board's readings cannot be right, in place of a fault.
            off_path: Called with every status report; returns its fault (`GuardedMotion.off_path`).
        """
        super().__init__({"": devices.board}, devices.cameras, cameras, fingers, detect, watch)
        self._cnc, self._on_fault, self._off_path = devices.cnc, on_fault, off_path
        self._fault: TacdataError | None = None
        self._trips: deque[tuple[int, int]] = deque(maxlen=TRIPS)
        self.frames = 0
        """Taxel frames received since the start."""
        self.position: tuple[float, float, float] | None = None
        """Latest reported machine position [mm]."""
        self._damage_then = self._damage()
        described = devices.board.describe()
        rate = described.get("rate", {}).get("nominal")
        self._health_of = lambda: ReadingHealth(reading_limits(described), rate, devices.board.clock.rate)
        self._health, self._on_bad_readings, self._quiet_until_ns = self._health_of(), on_bad_readings, 0
        if self._cnc.clock.rate > 1.0:
            self.silence = EMULATED
        # An emulated board faster than time shares this computer: it may wait where a real one goes on.
        is_timed = rate and devices.board.clock.rate == 1
        self._board_silence = max(BOARD_SILENCE, SILENT_FRAMES / rate) if is_timed else self.silence
        self._work[CONTROLLER], self._devices[CONTROLLER] = self._read_status, devices.cnc

    def __enter__(self) -> RigStreams:
        """Start the threads."""
        super().__enter__()
        return self

    @property
    def fault(self) -> TacdataError | None:
        """The first error of a stream or of writing, or None."""
        failure = self._sink.failure if self._sink else None
        if self._fault is None and failure is not None:
            text = f"writing failed: {failure}"
            self._fail(DeviceError(text, "a disk with free space", "free some space, then start again"))
        return self._fault

    @property
    def clock_models(self) -> dict[str, ClockModel | PolledClock]:
        """Clock of each stream, by name: "taxels", "camera NAME", "cnc"."""
        models = super().clock_models
        with self._lock:
            polled = polled_clock(*np.array(self._trips, np.int64).reshape(-1, 2).T)
        return models if polled is None else {**models, "cnc": polled}

    def nothing_yet(self, seconds: float) -> DeviceError:
        """Return the message when board or controller has delivered nothing of use for ``seconds`` [s]."""
        if self.frames >= 2 and self.position is None:
            text = f"the motion controller has sent no position for {seconds:g} s"
            return DeviceError(text, "a running stream", "check cable and power")
        return self._no_frames(seconds)

    def _no_frames(self, seconds: float) -> DeviceError:
        repeated, corrupt, garbage = (
            total - then for total, then in zip(self._damage(), self._damage_then, strict=True)
        )
        if repeated:
            return DeviceError(
                f"taxel board: its counter stands still; {repeated} frames came with a number already seen",
                "a counter that goes up by one with each frame",
                "check the board's firmware, and counter in the frame format",
            )
        if corrupt or garbage:
            return DeviceError(
                f"taxel board: no good frame for {seconds:g} s, but {corrupt} damaged ones and {garbage} bytes that "
                "belong to none",
                "a stream of good frames",
                "check cable, ground and baud rate, then the frame format",
            )
        busy = self._busy(BOARD)
        return DeviceError(
            f"{BOARD}: nothing received for {seconds:g} s{busy}",
            "a stream that goes on",
            TOO_BUSY if busy else "check cable and power, then start again",
        )

    def _totals(self) -> dict[str, StreamCounts]:
        return {**super()._totals(), "cnc": StreamCounts(corrupt=self._cnc.damaged_reports)}

    def _damage(self) -> tuple[int, int, int]:
        counts = self._totals()[TAXELS]
        return counts.repeated, counts.corrupt, counts.garbage_bytes

    def _fail(self, error: TacdataError) -> None:
        if self._fault is None:
            self._on_fault()
            self._fault = error

    def _delivered(self, name: str, count: int) -> None:
        if name == BOARD:
            self.frames += count
            self._damage_then = self._damage()

    def _read(self, stream: str, frames: list[TaxelFrame]) -> None:
        for frame in frames:
            words = self._health.take(frame.arrival_ns, frame.counts)
            if words and self._on_bad_readings:
                # Afresh: the same frozen frame must not be reported at every arrival.
                self._health = self._health_of()
                if frame.arrival_ns < self._quiet_until_ns:
                    continue
                self._quiet_until_ns = frame.arrival_ns + AGAIN_NS
                self._on_bad_readings(words)
                if self._sink:
                    self._sink.note(f"{stream}: {words}", "warning")
            elif words:
                raise BadReadings(
                    f"{stream}: {words}",
                    "readings that change, below their limit",
                    "check the board's supply, its ribbon cable and firmware, then start again",
                )

    def _waiting(self, name: str) -> float:
        # A guide whose reports wait unread is not watched: while a real one moves, nothing extends that.
        real = name == CONTROLLER and self._cnc.clock.rate <= 1.0
        return 0.0 if real else super()._waiting(name)

    def _silence_of(self, name: str) -> float:
        return self._board_silence if name == BOARD else self.silence

    def _silent(self, name: str) -> None:
        if name == BOARD:
            raise self._no_frames(self._board_silence)
        unreadable = "" if name.startswith("camera") else self._cnc.unreadable
        busy = self._busy(name)
        what = f"only reports that cannot be read, the latest {unreadable!r}," if unreadable else self._what(name)
        raise DeviceError(
            f"{name}: {what} for {self.silence:g} s{busy}",
            "a stream that goes on",
            TOO_BUSY if busy else "check cable and power, then start again",
        )

    def _broken(self, name: str, error: TacdataError) -> None:
        self._fail(error)

    def _read_status(self) -> int:
        statuses = self._cnc.statuses()
        with self._lock:
            for status in statuses:
                if wrong := self._off_path(status):
                    self._on_fault()  # after an earlier fault too: the lift itself may go astray
                    self._fault = self._fault or wrong
                x, y, z = status.position.tolist()
                self.position = (x, y, z)
                self._trips.append((status.sent_ns, status.arrival_ns))
                if self._feed:
                    self._feed.position(status.arrival_ns, self.position)
                if self._sink and status.arrival_ns >= self._sink.begun_ns:
                    self._sink.status(status)
        self._host.sleep(POLL)
        return len(statuses)
