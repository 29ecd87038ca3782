"""Visits of one unit: the virtual rig's skin pressed by the health plan, recorded without its clock.

The unit is drawn by its seed. A visit is drawn by its number: the sensor is put down and registered again, the tool
is mounted again, the room is a little warmer. Faults change the unit's truth, or its readings.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[1] / "recording"))
from recording_examples import LIMITS, SENSOR, T0, Header, Press, rig, rig_document

from tacdata import documents
from tacdata.devices.device import CncStatus
from tacdata.plans import Plan
from tacdata.plans.shipped.shipped_plan import shipped_plan
from tacdata.recording.session import create_session, refresh
from tacdata.virtual_rig.world.world import Truth, World, draw

RATE, MS = 30.0, 1_000_000
REGISTERED = (0.05, 0.05, 0.02)
"""Spread of a careful registration in x, y and depth [mm], as the sensor file states it."""
YAW, WARMTH, OWN, ZERO = 0.25, 0.01, 0.005, 20.0
"""Spread of a healthy unit from visit to visit: yaw [deg], common gain [1], each channel's gain [1], zero [counts]."""
DAY_NS = 86_400_000_000_000
PLAN = Plan.from_document(shipped_plan("health", SENSOR), "health")


@dataclass(frozen=True)
class Fault:
    """A fault of the unit at a visit."""

    truth: Callable[[Truth, np.random.Generator], Truth] = lambda truth, rng: truth
    """Changes the unit."""
    counts: Callable[[np.ndarray, np.ndarray], np.ndarray] = lambda counts, seconds: counts
    """Changes readings [counts], shape (n, taxels), at times since the visit's beginning [s], shape (n,)."""


class Recorded(Press):
    """One press of a visit."""

    def __init__(self, plan: Plan, number: int, world: World, start_ns: int, fault: Fault) -> None:
        """Carry it out; ``start_ns`` is when it begins after the visit's first."""
        self.rng, self.number, self.camera = np.random.default_rng(number), number, False
        board = {"channels": SENSOR.taxels.count, "rate": {"nominal": RATE, "unit": "Hz"}}
        controller = {
            "settings": {"banner": "emulated"},
            "acceleration": LIMITS.acceleration.tolist(),
            "max_rate": LIMITS.max_rate.tolist(),
        }
        self.header = Header(plan.presses[number], SENSOR, rig_document(), plan.document, board, controller)
        bench = rig()
        self.commands, self.path, self.views = [], [], []
        self._carry_out(bench)
        self.end = self.commands[-1].acknowledged_ns + 100 * MS
        self.sample = T0 + np.arange(0, self.end - T0, round(1e9 / RATE))
        self.counter = np.arange(len(self.sample)) + 500
        self.arrival = self.sample + self.rng.integers(1 * MS, 6 * MS, len(self.sample))
        sent = np.arange(T0, self.end, 125 * MS)
        self.statuses = [CncStatus(int(t), int(t) + 8 * MS, "Run", self.report(int(t) + 4 * MS), 0.0) for t in sent]
        tip, indenter = self.position(self.sample), self.header.press.indenter
        counts = [world.readings(p, indenter, 0.0, start_ns + int(t)) for p, t in zip(tip, self.sample, strict=True)]
        self.counts = fault.counts(np.array(counts), (self.sample - T0 + start_ns) / 1e9)
        self._begin_at(start_ns)

    def _begin_at(self, start_ns: int) -> None:
        """Move everything later."""
        self.sample, self.arrival, self.end = self.sample + start_ns, self.arrival + start_ns, self.end + start_ns
        self.statuses = [
            replace(s, sent_ns=s.sent_ns + start_ns, arrival_ns=s.arrival_ns + start_ns) for s in self.statuses
        ]
        self.commands = [
            replace(c, sent_ns=c.sent_ns + start_ns, acknowledged_ns=c.acknowledged_ns + start_ns)
            for c in self.commands
        ]


def unit(seed: int) -> Truth:
    """Return a unit."""
    return draw(seed, SENSOR, rig().registration)


def visited(truth: Truth, seed: int, visit: int) -> Truth:
    """Return the unit as a healthy one is at a visit: put down, registered and warm as that day."""
    rng = np.random.default_rng([seed, visit, 20])
    nominal = rig().registration
    off = rng.normal(0.0, REGISTERED)
    origin = tuple(float(a + b) for a, b in zip(nominal.origin, off, strict=True))
    gain = np.array(truth.gain) * rng.normal(1.0, WARMTH) * rng.normal(1.0, OWN, len(truth.gain))
    zero = np.array(truth.offset) + rng.normal(0.0, ZERO)
    return replace(
        truth,
        seed=1000 * seed + visit,
        registration=replace(nominal, origin=origin, yaw=nominal.yaw + float(rng.normal(0.0, YAW))),
        mount_yaw=float(rng.normal(0.0, 0.4)),
        gain=tuple(gain),
        offset=tuple(zero),
    )


def record(folder: Path, seed: int, visit: int, fault: Fault | None = None, plan: Plan = PLAN) -> Path:
    """Record a visit as a session; return its folder."""
    fault = fault or Fault()
    truth = fault.truth(visited(unit(seed), seed, visit), np.random.default_rng([seed, visit, 21]))
    session = create_session(folder, plan, SENSOR, rig_document())
    world, start_ns = World(truth, SENSOR), 0
    for number in range(len(plan.presses)):
        press = Recorded(plan, number, world, start_ns, fault)
        press.write(folder / f"episode-{number:06d}.mcap")
        start_ns = press.end - T0
    document = {**session.document, "started": f"2026-03-{1 + visit:02d}T09:00:00+00:00"}
    documents.write(folder / "session.json", document, "session")
    refresh(session)
    return folder
