"""Acceleration-limited motion along straight blocks, in closed form, as GRBL's planner computes it."""

from __future__ import annotations

import bisect
import math
import threading
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

MEMORY_NS = 120_000_000_000
"""How long the past motion is kept [ns]."""


@dataclass(frozen=True)
class Block:
    """One straight move."""

    start: np.ndarray
    """Where it begins [mm], shape (3,)."""
    end: np.ndarray
    """Where it ends [mm], shape (3,)."""
    speed: float
    """Programmed speed [mm/s]."""
    acceleration: float
    """Acceleration limit along the move [mm/s^2]."""
    kind: str = "Run"
    """State shown while it runs: Run, Jog or Home."""

    @cached_property
    def length(self) -> float:
        """Its length [mm]."""
        return float(np.linalg.norm(self.end - self.start))

    @cached_property
    def unit(self) -> np.ndarray:
        """Its direction [1], shape (3,)."""
        return (self.end - self.start) / self.length


@dataclass(frozen=True)
class Stretch:
    """A segment of motion with constant acceleration."""

    start_ns: int
    """When it begins [ns]."""
    seconds: float
    """How long it lasts [s]."""
    block: Block
    """The move that it belongs to."""
    way: float
    """Distance along the block at its beginning [mm]."""
    speed: float
    """Speed at its beginning [mm/s]."""
    acceleration: float
    """Signed acceleration [mm/s^2]."""

    def at(self, time_ns: int) -> tuple[float, float]:
        """Return distance along the block [mm] and speed [mm/s] at a time [ns], clipped to the segment."""
        t = min(max((time_ns - self.start_ns) * 1e-9, 0.0), self.seconds)
        return self.way + self.speed * t + 0.5 * self.acceleration * t * t, self.speed + self.acceleration * t


def axis_limit(direction: np.ndarray, limits: np.ndarray) -> float:
    """Return the largest value along a unit direction at which no axis exceeds its limit in ``limits``."""
    share = np.abs(direction)
    return float(np.min(limits[share > 1e-9] / share[share > 1e-9]))


class Planner:
    """Queue of blocks; knows the position at any time of the recent past and of the planned motion.

    Neighbouring blocks in line keep the lower of their speeds. At every other corner the machine comes to rest.
    """

    def __init__(self, position: np.ndarray, prepared: float = 0.0) -> None:
        """Stand still at ``position`` [mm]; motion is cut into steps ``prepared`` [s] ahead."""
        self.held = False
        self._prepared_ns = round(prepared * 1e9)
        self.blocks: list[Block] = []
        self._rest = np.array(position, dtype=float)  # position before the first stretch
        self._past: list[Stretch] = []
        self._starts: list[int] = []
        self._ends: list[int] = []  # when each planned block is finished [ns]
        self._lock = threading.RLock()

    @property
    def target(self) -> np.ndarray:
        """End of the last block [mm], shape (3,)."""
        with self._lock:
            return self.blocks[-1].end if self.blocks else self._final()

    def add(self, block: Block, now_ns: int) -> None:
        """Queue a block at the present time [ns]; one without length is ignored."""
        with self._lock:
            if block.length < 1e-9:
                return
            way, speed = self._cut(now_ns)
            self.blocks.append(block)
            if not self.held:
                self._plan(now_ns, way, speed)

    def hold(self, now_ns: int) -> None:
        """Brake to rest, keeping the queue, as soon as the steps that are prepared by now [ns] are done."""
        with self._lock:
            if self.held:
                return
            self.held = True
            now_ns += self._prepared_ns if self.moving(now_ns) else 0
            way, speed = self._cut(now_ns)
            self._ends, elapsed = [], 0.0
            for block in self.blocks:
                if speed <= 0:
                    break
                room = block.length - way
                exit_speed = math.sqrt(max(speed**2 - 2 * block.acceleration * room, 0.0))
                seconds = (speed - exit_speed) / block.acceleration
                self._append(now_ns, elapsed, seconds, block, way, speed, -block.acceleration)
                elapsed += seconds
                # A block is finished where braking goes on into the next one, or ends at its very end.
                if exit_speed > 0 or speed**2 >= 2 * block.acceleration * room - 1e-9:
                    self._ends.append(now_ns + round(elapsed * 1e9))
                way, speed = 0.0, exit_speed

    def resume(self, now_ns: int) -> None:
        """Continue from rest."""
        with self._lock:
            if self.held:
                way, speed = self._cut(now_ns)
                self.held = False
                self._plan(now_ns, way, speed)

    def stall(self, now_ns: int, until_ns: int) -> None:
        """Stand still from now until then [ns], without braking; go on from rest: no steps are prepared meanwhile."""
        with self._lock:
            if self.blocks and not self.held:
                way, _ = self._cut(now_ns)
                self._plan(until_ns, way, 0.0)

    def stop(self, now_ns: int) -> bool:
        """Stop at once and clear the queue; return True if something was moving."""
        with self._lock:
            moving = self.moving(now_ns)
            self._cut(now_ns)
            self.blocks, self._ends, self.held = [], [], False
            return moving

    def retire(self, now_ns: int) -> int:
        """Drop finished blocks; return the number left."""
        with self._lock:
            while self._ends and self._ends[0] <= now_ns:
                self._ends.pop(0)
                self.blocks.pop(0)
            return len(self.blocks)

    def moving(self, time_ns: int) -> bool:
        """Whether the machine moves at a time [ns]."""
        with self._lock:
            stretch = self._stretch(time_ns)
            return stretch is not None and time_ns < stretch.start_ns + round(stretch.seconds * 1e9)

    def next_end(self) -> int | None:
        """Return when the running block will end [ns], or when a hold comes to rest."""
        with self._lock:
            if self._ends:
                return self._ends[0]
            return self._end_of(self._past[-1]) if self._past and self.held else None

    @property
    def rest_ns(self) -> int | None:
        """When the planned motion ends, or the last one ended [ns]; None if nothing ever moved."""
        with self._lock:
            return self._end_of(self._past[-1]) if self._past else None

    def scale(self, factor: float, now_ns: int) -> None:
        """Change the speed of all queued blocks, the running one included, from now on [ns]."""
        with self._lock:
            if not self.blocks:
                return
            way, speed = self._cut(now_ns)
            self.blocks = [replace(block, speed=block.speed * factor) for block in self.blocks]
            if not self.held:
                self._plan(now_ns, way, speed)

    def position(self, time_ns: int) -> np.ndarray:
        """Return the position [mm], shape (3,), at a time [ns]."""
        with self._lock:
            stretch = self._stretch(time_ns)
            if stretch is None:
                return self._rest.copy()
            return stretch.block.start + stretch.at(time_ns)[0] * stretch.block.unit

    def speed(self, time_ns: int) -> float:
        """Return the speed [mm/s] at a time [ns]."""
        with self._lock:
            stretch = self._stretch(time_ns)
            return stretch.at(time_ns)[1] if stretch is not None and self.moving(time_ns) else 0.0

    def _stretch(self, time_ns: int) -> Stretch | None:
        index = bisect.bisect_right(self._starts, time_ns) - 1
        return self._past[index] if index >= 0 else None

    @staticmethod
    def _end_of(stretch: Stretch) -> int:
        return stretch.start_ns + round(stretch.seconds * 1e9)

    def _final(self) -> np.ndarray:
        if not self._past:
            return self._rest
        last = self._past[-1]
        return last.block.start + last.at(self._end_of(last))[0] * last.block.unit

    def _cut(self, now_ns: int) -> tuple[float, float]:
        """Discard the planned motion; return distance along the first unfinished block [mm] and speed [mm/s]."""
        self.retire(now_ns)
        stretch, moving = self._stretch(now_ns), self.moving(now_ns)
        while self._past and self._starts[-1] >= now_ns:
            self._past.pop()
            self._starts.pop()
        if stretch is None or not self.blocks:
            way, speed = 0.0, 0.0
        else:
            way, speed = stretch.at(now_ns) if stretch.block is self.blocks[0] else (0.0, 0.0)
            speed = speed if moving else 0.0
        if moving and self._past:
            last = self._past[-1]
            seconds = min(last.seconds, (now_ns - last.start_ns) * 1e-9)
            self._past[-1] = Stretch(last.start_ns, seconds, last.block, last.way, last.speed, last.acceleration)
        # The last stretch that began before the memory does stays: it holds the position there.
        while len(self._past) > 1 and self._starts[1] < now_ns - MEMORY_NS:
            self._past.pop(0)
            self._starts.pop(0)
        return way, speed

    def _append(
        self, now_ns: int, elapsed: float, seconds: float, block: Block, way: float, speed: float, rate: float
    ) -> None:
        if seconds > 1e-9:
            start_ns = now_ns + round(elapsed * 1e9)
            self._past.append(Stretch(start_ns, seconds, block, way, speed, rate))
            self._starts.append(start_ns)

    def _plan(self, now_ns: int, way: float, speed: float) -> None:
        blocks, self._ends, elapsed = self.blocks, [], 0.0
        # From the end: no block is entered faster than the blocks after it can brake from.
        entry = [0.0] * (len(blocks) + 1)
        for i in range(len(blocks) - 1, 0, -1):
            in_line = float(blocks[i - 1].unit @ blocks[i].unit) > 1 - 1e-6
            corner = min(blocks[i - 1].speed, blocks[i].speed) if in_line else 0.0
            entry[i] = min(corner, math.sqrt(entry[i + 1] ** 2 + 2 * blocks[i].acceleration * blocks[i].length))
        for i, block in enumerate(blocks):
            a, room = block.acceleration, max(block.length - way, 0.0)
            exit_speed = min(entry[i + 1], math.sqrt(speed**2 + 2 * a * room))
            peak = max(min(block.speed, math.sqrt(max(a * room + 0.5 * (speed**2 + exit_speed**2), 0.0))), exit_speed)
            rise, fall = (peak - speed) / a, (peak - exit_speed) / a
            far = way + (speed + peak) / 2 * rise
            cruise = max(block.length - (peak + exit_speed) / 2 * fall - far, 0.0) / peak if peak > 0 else 0.0
            self._append(now_ns, elapsed, abs(rise), block, way, speed, math.copysign(a, rise))
            self._append(now_ns, elapsed + abs(rise), cruise, block, far, peak, 0.0)
            self._append(now_ns, elapsed + abs(rise) + cruise, fall, block, far + peak * cruise, peak, -a)
            elapsed += abs(rise) + cruise + fall
            self._ends.append(now_ns + round(elapsed * 1e9))
            way, speed = 0.0, exit_speed
