"""A drawn press as the recording that a rig would make of it, but for its readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tacdata.plans import Press
from tacdata.recording.episode import CncStream, Episode, Phase, TaxelStream
from tacdata.recording.motion.trapezoid import Trapezoid
from tacdata.sensor import Sensor

RIG = "simulated"
"""Name of the rig in records."""
STANDOFF = 0.3
"""Height from which the tip presses, and to which it is lifted [mm]."""
CLEARANCE = 1.0
"""Height at which it rests [mm]."""
APPROACH_SPEED = 5.0
"""Speed between the two [mm/s]."""
ACCELERATION = 100.0
"""Of all moves [mm/s^2], as the virtual rig's vertical axis."""


def timeline(press: Press, sensor: Sensor, rng: np.random.Generator) -> Episode:
    """Return a press at the board's rate: rest, approach, press, hold, release, recovery; all readings are 0.

    Args:
        press: The press; its ``rest`` is a number.
        sensor: The skin; its rate is the board's.
        rng: Draws when within a frame's time the motion begins.
    """
    moves = [
        ("rest", -CLEARANCE, press.rest or 0.0, 0.0),
        ("approach", -STANDOFF, 0.0, APPROACH_SPEED),
        ("press", press.depth, 0.0, press.speed),
        ("hold", press.depth, press.hold, 0.0),
        ("release", -STANDOFF, 0.0, press.speed),
        ("", -CLEARANCE, 0.0, APPROACH_SPEED),
        ("", -CLEARANCE, press.recovery, 0.0),
    ]
    period = 1e9 / sensor.taxels.rate
    start = float(rng.uniform(0.0, period))
    times, depths, phases = [np.array([0.0, start])], [np.array([-CLEARANCE] * 2)], []
    clock, at = start, -CLEARANCE
    for name, depth, pause, speed in moves:
        time, path = _motion(at, depth, pause, speed)
        times.append(clock + time)
        depths.append(path)
        if name:
            phases.append(Phase(name, round(clock if name != "rest" else 0.0), round(clock + time[-1])))
        clock, at = clock + time[-1], depth
    # Neighbouring moves share a knot, and times of a path must increase.
    tip_ns, first = np.unique(np.concatenate(times).round().astype(np.int64), return_index=True)
    depth = np.concatenate(depths)[first]
    tip = np.column_stack([np.full(len(depth), press.x), np.full(len(depth), press.y), depth])
    frames = int(clock // period) + 1
    sample_ns = (np.arange(frames) * period).round().astype(np.int64)
    stream = TaxelStream(sample_ns, sample_ns, np.arange(frames), np.zeros((frames, sensor.taxels.count)))
    return Episode(
        path=Path(f"press-{press.index:06d}"),
        press=press,
        sensor=sensor,
        rig={"name": RIG, "clock": {}},
        taxels=stream,
        cnc=CncStream(tip_ns[:0], tip_ns[:0], tip[:0], ()),
        tags=(),
        phases=tuple(phases),
        tip_ns=tip_ns,
        tip=tip,
        complete=True,
        notes=(),
    )


def _motion(start: float, end: float, pause: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times since its start [ns] and depths [mm] of a move from rest to rest, or of a pause."""
    if not speed:
        # From 1 ns on, as the move before has a knot at 0; at least 2 ns, so that times increase.
        return np.array([1.0, max(1e9 * pause, 2.0)]), np.array([end, end])
    move = Trapezoid(np.array([0.0, 0.0, start]), np.array([0.0, 0.0, end]), speed, ACCELERATION)
    time, place = move.knots()
    return 1e9 * time, place[:, 2]
