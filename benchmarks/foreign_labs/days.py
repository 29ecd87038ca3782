"""Presses on several days: a sensor that is mounted again each morning, a folder and a mapping a day."""

import numpy as np
import path
from recordings import channels, encoder, stamps

OFF = (0.0, 0.08, -0.05)
"""By how much each day's touch-off is wrong [mm]."""
PRESSES = 12
"""A day."""


def record(files, rng, skin, board):
    """Write the days, each with gains, offsets and a depth zero of its own."""
    for day, off in enumerate(OFF):
        board.gains = board.gains * (1 + 0.04 * rng.standard_normal())
        board.offsets = board.offsets + 0.03 * board.range * rng.standard_normal(board.channels)
        for k in range(PRESSES):
            ((moves, _),) = path.presses(rng, 1, (0.8, 1.9), (0.5, 2.0, 6.0))
            time, depths = path.course(moves)
            _, loads = skin.pressed(depths + off + 0.008 * rng.standard_normal())
            reading = board.pressed(loads)
            at = stamps(rng, time[-1], 60, 0.05)
            said = board.said(time, reading, at)
            clock = 86400 * day + 30 * k + 1000
            depth = encoder(rng, np.interp(at, time, depths))
            both = {"t_ms": ((at + clock) * 1e3, "%.1f"), "depth_um": (depth * 1e3, "%.1f")}
            files.table(f"day{day + 1}/{k:02d}.csv", both | channels(said, "%.0f", "R"))
    for day in range(1, len(OFF) + 1):
        time = {"column": "t_ms", "unit": "ms", "zero": "shared"}
        parts = {
            "files": {"log": {"path": f"raw/day{day}/{{trial}}.csv", "time": time}},
            "position": {"file": "log", "depth": {"column": "depth_um", "unit": "um"}},
        }
        files.mapping(board.unit, "log", parts, "R*", f"{files.name} day{day}", f"mapping_day{day}.yaml")
