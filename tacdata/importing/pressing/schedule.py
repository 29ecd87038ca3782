"""A press schedule in place of a measured position: the commanded path from times, depths and speeds."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import Axis, Schedule
from tacdata.importing.source_table import SourceTable, axis
from tacdata.importing.streams import Stream
from tacdata.importing.times import YEAR_2000, times
from tacdata.recording.episode import Phase

UNITS = {"depth": "mm", "speed": "mm/s", "hold": "s", "height": "mm", "x": "mm", "y": "mm", "release_speed": "mm/s"}
"""Columns of a schedule's file, in the order of `ScheduledPress`."""


@dataclass(frozen=True)
class ScheduledPress:
    """One press of a schedule."""

    start_ns: int
    """Beginning of the motion down [ns]."""
    depth: float
    """Full depth [mm]."""
    speed: float
    """Speed down [mm/s]."""
    hold: float
    """Time at full depth [s]."""
    height: float
    """Height above the skin at the start [mm]."""
    x: float
    y: float
    release_speed: float
    """Speed up [mm/s]."""

    @property
    def knots(self) -> tuple[np.ndarray, np.ndarray]:
        """Times [ns], shape (4,), and positions with -depth as z [mm], shape (4, 3), linear in between."""
        down, up = (round((self.depth + self.height) / speed * 1e9) for speed in (self.speed, self.release_speed))
        hold = round(self.hold * 1e9)
        time_ns = self.start_ns + np.array([0, down, down + hold, down + hold + up], dtype=np.int64)
        z = np.array([self.height, -self.depth, -self.depth, self.height])
        return time_ns, np.stack([np.full(4, self.x), np.full(4, self.y), z], axis=1)

    def phases(self, begin_ns: int) -> tuple[Phase, ...]:
        """Return its phases, with a rest from a time [ns] on."""
        down, full, up, end = self.knots[0].tolist()
        marks = (("rest", begin_ns, down), ("press", down, full), ("hold", full, up), ("release", up, end))
        return tuple(Phase(*mark) for mark in marks if mark[2] > mark[1])


def read_schedule(schedule: Schedule | None, tables: dict[str, SourceTable], taxels: Stream) -> list[ScheduledPress]:
    """Return the presses of a schedule in the order of time; [] without one.

    Times in a list of presses count from the zero of the channels' clock. If that clock is Unix time and the list's is
    not, they count from the channels' first row.

    Raises:
        FormatError: If a column is missing, presses overlap or lie outside the recorded time.
    """
    if schedule is None:
        return []
    presses = _listed(schedule, taxels) if schedule.presses else _tabled(schedule, tables)
    presses.sort(key=lambda press: press.start_ns)
    for previous, following in pairwise(presses):
        if previous.knots[0][-1] > following.start_ns:
            raise FormatError(
                f"schedule: the press at {following.start_ns / 1e9:.3f} s begins before the one before it ends",
                "presses one after the other",
                "correct start, speed or hold",
            )
    inside = [p for p in presses if p.start_ns <= taxels.time_ns[-1] and p.knots[0][-1] >= taxels.time_ns[0]]
    if not inside:
        raise FormatError(
            "schedule: no press lies within the time of the channels, "
            f"{taxels.time_ns[0] / 1e9:.3f} to {taxels.time_ns[-1] / 1e9:.3f} s",
            "presses within it",
            "correct start, or the schedule's time: {offset: SECONDS}",
        )
    return inside


def _listed(schedule: Schedule, taxels: Stream) -> list[ScheduledPress]:
    zero = schedule.clock.offset_ns
    # Nobody writes a schedule in Unix time by hand: small numbers count from the first row.
    if taxels.zero == "unix" and schedule.presses[0].start < YEAR_2000:
        zero += int(taxels.time_ns[0])
    return [
        ScheduledPress(
            zero + round(p.start * 1e9), p.depth, p.speed, p.hold, p.height, p.x, p.y, p.release_speed or p.speed
        )
        for p in schedule.presses
    ]


def _tabled(schedule: Schedule, tables: dict[str, SourceTable]) -> list[ScheduledPress]:
    start = schedule.axes.get("start")
    if schedule.file not in tables or start is None:
        raise FormatError(
            "schedule without presses, or without file and start",
            "presses: a list, or file: NAME with start, depth and speed as columns",
            "complete the schedule",
        )
    table, clock = tables[schedule.file], schedule.clock
    if isinstance(start, Axis):
        clock = replace(clock, column=start.column, unit=start.unit or clock.unit)
    start_ns, _ = times(table, clock, "schedule: start")
    axes = {"release_speed": schedule.axes.get("speed", 0.0)} | schedule.axes
    values = {
        name: np.broadcast_to(axis(table, axes.get(name, 0.0), unit, f"schedule: {name}"), (table.rows,))
        for name, unit in UNITS.items()
    }
    if not all((np.isfinite(values[name]) & (values[name] > 0)).all() for name in ("speed", "release_speed")):
        raise FormatError("schedule: a speed that is not above 0 mm/s", "above 0 mm/s", "correct the speed")
    rows = zip(*(column.tolist() for column in values.values()), strict=True)
    return [ScheduledPress(int(t), *row) for t, row in zip(start_ns.tolist(), rows, strict=True)]
