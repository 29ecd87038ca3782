"""Single presses: a stage that logs its position, and a board that logs its readings, each with its own stamps."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import path
from recordings import channels, encoder, stamps

BEGIN = 1000.0
"""The clock when the first press begins [s]."""


@dataclass(frozen=True)
class Bench:
    """How a lab records presses."""

    rate: float = 60.0
    """Rows of the board a second [Hz]."""
    stage_rate: float = 100.0
    """Rows of the stage a second [Hz]."""
    jitter: float = 0.05
    """Of the board's rows [1]."""
    lost: float = 0.005
    """Share of the board's rows that is lost [1]."""
    latency: float = 0.0
    """How late the board's stamps are [s]."""
    ahead: float = 0.0
    """How far ahead the stage's clock is, by the mapping [s]."""
    lag: float = 0.0
    """Time constant of a low pass behind the transducers [s]."""
    gains: Callable | None = None
    """Clock [s], shape (n,) -> gain of all channels [1], shape (n,)."""
    spoilt: Callable | None = None
    """Readings of shape (rows, channels) and number of the press -> readings."""
    touch: float = 0.01
    """Spread of where a press finds the skin [mm]."""
    force: float = 0.0
    """Noise of a load cell, and spread of its zero [N]; 0 is none."""
    laser: bool = False
    """Whether a laser sees the tip."""
    together: bool = False
    """Whether the board logs depths too: one file a press, in ms and um."""
    pause: float = 20.0
    """Between two presses [s]."""

    def record(self, files, rng, skin, board, runs):
        """Write runs, (moves, place) of each, and the mapping."""
        clock, several = BEGIN, any(place != path.ONLY for _, place in runs)
        for k, (moves, place) in enumerate(runs):
            time, depths = path.course(moves)
            off = self.touch * rng.standard_normal()
            tip, loads = skin.pressed(depths + off, place)
            gain = self.gains(clock + time) if self.gains else 1.0
            reading = board.pressed(loads, place, self.lag, gain)
            at = stamps(rng, time[-1], self.rate, self.jitter, self.lost)
            said = board.said(time, reading, at)
            said = self.spoilt(said, k) if self.spoilt else said
            # Drawn even where nobody keeps it: later draws depend on it.
            stage = self._stage(rng, clock, time, depths, tip - off, loads, place if several else None)
            stamped = at + clock + self.latency
            if self.together:
                depth = encoder(rng, np.interp(at, time, depths))
                both = {"t_ms": (stamped * 1e3, "%.1f"), "depth_um": (depth * 1e3, "%.1f")}
                files.table(f"{k:03d}.csv", both | channels(said))
            else:
                files.table(f"{k:03d}_stage.csv", stage)
                files.table(f"{k:03d}_sensor.csv", {"stamp_s": (stamped, "%.4f")} | channels(said))
            clock += time[-1] + self.pause
        if self.together:
            files.mapping(board.unit, "log", _one_file())
        else:
            files.mapping(board.unit, "sensor", self._two_files(several))

    def _stage(self, rng, clock, time, depths, tip, loads, place):
        """Return the stage's columns."""
        at = stamps(rng, time[-1], self.stage_rate, 0.01)
        columns = {
            "time_s": (at + clock + self.ahead, "%.4f"),
            "crosshead_mm": (encoder(rng, np.interp(at, time, depths)), "%.4f"),
        }
        if place is not None:
            columns |= {name: (np.full(len(at), value), "%.2f") for name, value in zip("XY", place, strict=True)}
        if self.laser:
            seen = np.interp(at, time, tip) + 3.2 + 0.002 * rng.standard_normal(len(at))
            columns["laser_mm"] = np.round(seen / 0.001) * 0.001, "%.4f"
        if self.force:
            noise = rng.standard_normal(len(at))
            measured = np.interp(at, time, loads) + self.force * noise + self.force * rng.standard_normal()
            columns["Fz_N"] = measured, "%.4f"
        return columns

    def _two_files(self, several):
        position = {"file": "stage", "depth": {"column": "crosshead_mm", "unit": "mm"}}
        if several:
            position |= {"x": {"column": "X", "unit": "mm"}, "y": {"column": "Y", "unit": "mm"}}
        time = {"column": "time_s", "unit": "s", "zero": "shared"}
        if self.ahead:
            time["offset"] = -self.ahead
        parts = {
            "files": {
                "stage": {"path": "raw/{trial}_stage.csv", "time": time},
                "sensor": {
                    "path": "raw/{trial}_sensor.csv",
                    "time": {"column": "stamp_s", "unit": "s", "zero": "shared"},
                },
            },
            "position": position,
        }
        measured = {}
        if self.force:
            measured["force"] = {"file": "stage", "columns": "Fz_N", "unit": "N"}
        if self.laser:
            measured["laser"] = {"file": "stage", "columns": "laser_mm", "unit": "mm"}
        return parts | ({"measured": measured} if measured else {})


def _one_file():
    time = {"column": "t_ms", "unit": "ms", "zero": "shared"}
    return {
        "files": {"log": {"path": "raw/{trial}.csv", "time": time}},
        "position": {"file": "log", "depth": {"column": "depth_um", "unit": "um"}},
    }
