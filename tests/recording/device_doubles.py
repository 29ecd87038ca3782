"""A rig in memory: devices derived from the abstract classes, with faults to plant."""

import threading
import time

import numpy as np
from recording_examples import LIMITS

from tacdata.devices.device import (
    Camera,
    CncStatus,
    ImageFrame,
    Motion,
    MotionController,
    StreamCounts,
    TaxelBoard,
    TaxelFrame,
)
from tacdata.errors import DeviceError


class Controller(MotionController):
    """Moves in straight lines from rest to rest; `calls` says what was asked of it."""

    def __init__(self, clock, at=(10.0, 20.0, -20.0)):
        super().__init__(clock)
        self.calls, self.refuses, self.fault_at, self.on_fault = [], False, None, None
        self._at, self._move, self._begin, self._until = np.array(at, float), None, 0, 0
        self._told, self._reset, self._held = 0, threading.Event(), False
        self._lock = threading.RLock()

    def describe(self):
        return {}

    def open(self):
        self.calls.append("open")

    def close(self):
        self.calls.append("close")

    def settings(self):
        return {"banner": "double", "$110": "3000", "homed_before": "yes"}

    @property
    def acceleration(self):
        return LIMITS.acceleration

    @property
    def max_rate(self):
        return LIMITS.max_rate

    def position(self, time_ns=None):
        """Where it is now, or was at a time since the present move was sent [ns]."""
        with self._lock:
            if self._move is None:
                return self._at.copy()
            seconds = ((time_ns or self.clock.now_ns()) - self._begin) / 1e9
            share = self._move.distance(max(seconds, 0.0)) / max(self._move.length, 1e-12)
            return self._move.start + share * (self._move.target - self._move.start)

    def _wait(self, until_ns):
        while self.clock.now_ns() < until_ns:
            if self._reset.wait(0.001):
                raise DeviceError("the line was thrown away by a reset", "none", "send it again")

    def move(self, position, speed):
        self.calls.append(("move", tuple(round(v, 6) for v in position)))
        if self.refuses:
            raise DeviceError("the controller does not obey", "one that does", "free it by hand")
        sent = self.clock.now_ns()
        self._wait(self._until)
        broken = self.fault_at == sum(call[0] == "move" for call in self.calls)
        with self._lock:
            self._reset.clear()
            self._at = self.position()
            # The move that a fault stops takes its time: on a busy machine the fault still comes in mid-move.
            self._move = LIMITS.straight_move(self._at, np.array(position), speed / (20 if broken else 1))
            self._begin = self.clock.now_ns()
            self._until = self._begin + round(self._move.duration * 1e9)
        if broken:
            threading.Timer(0.025 * self._move.duration / self.clock.rate, self.on_fault).start()
        return Motion("G1", sent, self.clock.now_ns())

    def dwell(self, seconds):
        self.calls.append(("dwell", seconds))
        sent = self.clock.now_ns()
        self._wait(max(self._until, sent) + round(seconds * 1e9))
        return Motion("G4", sent, self.clock.now_ns())

    def wait_idle(self, timeout):
        self._wait(self._until)

    def statuses(self):
        now = self.clock.now_ns()
        if now - self._told < 100_000_000:
            return []
        self._told = now
        position = np.round(self.position(), 3)
        move = self._move
        moves = move is not None and not np.allclose(position, move.target, atol=1e-3)
        state = "Hold:0" if self._held else "Run" if moves else "Idle"
        return [CncStatus(now, self.clock.now_ns(), state, position, 0.0)]

    def feed_hold(self):
        with self._lock:
            self._at, self._move, self._held = self.position(), None, True
        self.calls.append("feed_hold")
        self._reset.set()

    def resume(self):
        self.calls.append("resume")
        self._held = False

    def abandon(self):
        self.calls.append("abandon")
        if self.refuses:
            raise DeviceError("the controller does not obey", "one that does", "free it by hand")
        self._until, self._held = 0, False
        self._reset.set()
        x, y, z = self.position().tolist()
        return x, y, z


class Board(TaxelBoard):
    """24 channels at 30 Hz of its clock; answers to where the controller is."""

    def __init__(self, clock, cnc, surface=-30.0):
        super().__init__(clock)
        self.counts, self._cnc, self.surface = StreamCounts(), cnc, surface
        self._rng, self._next, self.broken = np.random.default_rng(0), 0, None

    def describe(self):
        return {"channels": 24, "rate": {"nominal": 30.0, "unit": "Hz"}}

    def open(self):
        self._start = self.clock.now_ns()

    def close(self):
        pass

    def read(self, timeout):
        time.sleep(timeout / self.clock.rate)
        if self.broken:
            raise self.broken
        frames, now = [], self.clock.now_ns()
        while (sampled_ns := self._start + self._next * 33_333_333) <= now:
            depth = max(self.surface - self._cnc.position(sampled_ns)[2], 0.0)
            counts = np.round(9000 + 800 * depth + self._rng.normal(0, 5, 24))
            frames.append(TaxelFrame(now, self._next, counts))
            self._next += 1
        self.counts.received += len(frames)
        return frames


class Eye(Camera):
    """10 grey images a second of its clock."""

    def __init__(self, clock):
        super().__init__(clock)
        self._next = 0

    def describe(self):
        return {}

    def open(self):
        self._start = self.clock.now_ns()

    def close(self):
        pass

    def read(self, timeout):
        time.sleep(timeout / self.clock.rate)
        frames = []
        while self._start + self._next * 100_000_000 <= self.clock.now_ns():
            image = np.full((48, 64), self._next % 256, np.uint8)
            frames.append(ImageFrame(self.clock.now_ns(), self._next, image))
            self._next += 1
        return frames
