"""Sessions of real recordings on the disk, of short presses that a stand-in model answers at once."""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / "recording"))

import recording_examples as examples

from tacdata.plans import Plan
from tacdata.recording.session import create_session


class Recorded(examples.Press):
    """A press of a given plan, at 30 frames a second."""

    def __init__(self, plan, number):
        self.rng, self.number, self.camera = np.random.default_rng(number), number, False
        self.header = examples.Header(
            plan.presses[number],
            examples.SENSOR,
            examples.rig_document(),
            plan.document,
            {"channels": 24, "rate": {"nominal": 30.0, "unit": "Hz"}},
            {
                "settings": {"banner": "test"},
                "acceleration": examples.LIMITS.acceleration.tolist(),
                "max_rate": examples.LIMITS.max_rate.tolist(),
            },
        )
        bench = examples.rig()
        self.commands, self.path = [], []
        self._carry_out(bench)
        self.end = self.commands[-1].acknowledged_ns + 100_000_000
        self.sample = examples.T0 + np.arange(0, self.end - examples.T0, round(1e9 / 30.0))
        self.counter = np.arange(len(self.sample)) + 500
        self.arrival = self.sample + self.rng.integers(1_000_000, 6_000_000, len(self.sample))
        self.counts = self._counts(bench.registration.to_sensor(self.position(self.sample)))
        sent = np.arange(examples.T0, self.end, 125_000_000)
        self.statuses = [
            examples.CncStatus(int(t), int(t) + 8_000_000, "Run", self.report(int(t) + 4_000_000), 0.0) for t in sent
        ]
        self.views = []


def session(folder, count, first=0):
    """Record a session of ``count`` presses, all different; return its folder."""
    document = examples.plan_document(1)
    document["presses"] = [
        {"indenter": "ball", "x": round(-6 + 0.05 * (k % 240), 3), "y": round(-3 + 0.05 * (k // 240), 3), "depth": 0.8}
        for k in range(first, first + count)
    ]
    plan = Plan.from_document(document, "many")
    create_session(folder, plan, examples.SENSOR, examples.rig_document())
    for number in range(count):
        Recorded(plan, number).write(folder / f"episode-{number:06d}.mcap")
    return folder
