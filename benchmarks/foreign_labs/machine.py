"""One long recording by a testing machine that logs its own stage, which counts downwards, and the board together."""

from dataclasses import dataclass

import numpy as np
import path
from recordings import channels, encoder, stamps

TOUCHED = 20.0
"""Position of the stage when the tool touches the skin [mm]."""


@dataclass(frozen=True)
class Machine:
    """How a lab records one long test."""

    rate: float = 50.0
    """Rows a second [Hz]."""
    latency: float = 0.0
    """How late readings are [s]."""
    lag: float = 0.0
    """Time constant of a low pass behind the transducers [s]."""
    force: float = 0.0
    """Noise of a load cell [N]; 0 is none."""
    laser: bool = False
    """Whether a laser sees the tip."""
    separator: str = ","
    """Between columns."""
    decimal: str = "."
    """In numbers."""

    def record(self, files, rng, skin, board, moves):
        """Write one file and the mapping."""
        time, depths = path.course(moves)
        tip, loads = skin.pressed(depths)
        reading = board.pressed(loads, lag=self.lag)
        at = stamps(rng, time[-1], self.rate, 0.03)
        said = board.said(time, reading, np.maximum(at - self.latency, 0))
        stage = TOUCHED - encoder(rng, np.interp(at, time, depths))
        columns, measured = {"Time (s)": (at, "%.4f"), "Position (mm)": (stage, "%.4f")}, {}
        if self.laser:
            seen = (np.interp(at, time, tip) + 1) * 1e3 + 2 * rng.standard_normal(len(at))
            columns["Laser (um)"] = np.round(seen), "%.0f"
            measured["laser"] = {"file": "log", "columns": "Laser (um)", "unit": "um"}
        if self.force:
            columns["Load (N)"] = np.interp(at, time, loads) + self.force * rng.standard_normal(len(at)), "%.4f"
            measured["force"] = {"file": "log", "columns": "Load (N)", "unit": "N"}
        files.table("test.csv", columns | channels(said), self.separator, self.decimal)
        parts = {
            "files": {"log": {"path": "raw/test.csv", "time": {"column": "Time (s)", "unit": "s"}}},
            "position": {"file": "log", "x": 0, "y": 0, "z": {"column": "Position (mm)", "unit": "mm"}},
            "contact": {"x": 0, "y": 0, "z": TOUCHED, "known_from": "touch-off"},
        }
        files.mapping(board.unit, "log", parts | ({"measured": measured} if measured else {}))
