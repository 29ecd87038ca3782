"""One press of a session as a good rig records it, on the session's skin; faults change its attributes."""

import numpy as np
from recording_examples import SENSOR, T0, Press, plan_document, rig, rig_document
from skins import INDENTERS, Skin

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts
from tacdata.plans import Plan
from tacdata.recording.check.figures import figures
from tacdata.recording.clocks import envelope_fit
from tacdata.recording.clocks.polled_clock import polled_clock
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.writer import EpisodeWriter, Header

PRESSES, RATE, MS = 24, 30.0, 1_000_000
BOARD = {"channels": 24, "rate": {"nominal": RATE, "unit": "Hz"}, "format": {"channels": {"type": "uint16"}}}


def plan_of(seed):
    """Return a plan of `PRESSES` presses at drawn sites and depths; every second session has two indenters."""
    rng = np.random.default_rng([seed, 1])
    document = plan_document(1)
    document["indenters"] = {name: {"shape": "sphere", "radius": INDENTERS[name][0]} for name in INDENTERS}
    names = list(INDENTERS)[: 1 + seed % 2]
    document["presses"] = [
        {"indenter": names[rng.integers(len(names))], "x": round(x, 2), "y": round(y, 2), "depth": round(depth, 2)}
        for x, y, depth in rng.uniform([-4.7, -3.7, 0.6], [4.7, 3.7, 1.0], (PRESSES, 3))
    ]
    return Plan.from_document(document, "drawn")


class Recorded(Press):
    """One press."""

    def __init__(self, plan, number, seed):
        """Carry out one press of the plan; ``number`` counts from 0."""
        self.rng, self.number, self.camera = np.random.default_rng([seed, number]), number, False
        controller = {**Press(0).header.controller}
        self.header = Header(plan.presses[number], SENSOR, rig_document(), plan.document, dict(BOARD), controller)
        self.skin = Skin(seed, SENSOR.taxels, PRESSES)
        self.bench, self.commands, self.path = rig(), [], []
        self._carry_out(self.bench)
        self.end = self.commands[-1].acknowledged_ns + 100 * MS
        self.driver, self.complete = StreamCounts(), True
        self.sampled(RATE)
        sent = np.arange(T0, self.end, 125 * MS)
        self.statuses = [CncStatus(int(t), int(t) + 8 * MS, "Run", self.report(int(t) + 4 * MS), 0.0) for t in sent]
        self.views = []

    def sampled(self, rate):
        """Sample the press at a rate [Hz]."""
        self.sample = T0 + np.arange(0, self.end - T0, round(1e9 / rate))
        self.counter = np.arange(len(self.sample)) + 500
        self.arrival = self.sample + self.rng.integers(1 * MS, 6 * MS, len(self.sample))
        self.felt()

    def felt(self, x=0.0, y=0.0, up=0.0, late_ns=0):
        """Let the skin answer to a tip that is off by so much [mm], at another time [ns]."""
        tip = self.bench.registration.to_sensor(self.position(self.sample - late_ns))
        tip += np.array([x, y, -up])
        self.counts = self.skin.counts(tip, self.header.press.indenter_name, self.number, 1 / RATE, self.rng)

    def written(self, folder):
        """Write it and return its figures."""
        path = folder / f"episode-{self.number:06d}.mcap"
        path.unlink(missing_ok=True)
        writer = EpisodeWriter(path, self.header, Clock(T0, 0, 1.0))
        self.feed(writer)
        model = envelope_fit.fit(self.arrival, self.counter)
        sent, arrival = (np.array([getattr(s, name) for s in self.statuses]) for name in ("sent_ns", "arrival_ns"))
        models = {"taxels": model, "cnc": polled_clock(sent, arrival) if len(sent) else None}
        self.driver.received = len(self.sample)
        writer.close(self.complete, "", {k: m for k, m in models.items() if m}, {"taxels": self.driver})
        return figures(read_recording(path))

    def row(self, share=0.5):
        """Return the row in the middle of the hold, or at another share of it."""
        hold = next(c for c in self.commands if c.phase == "hold" and not c.is_move)
        return int(np.searchsorted(self.sample, hold.acknowledged_ns - (1 - share) * 0.6e9))

    @property
    def strongest(self):
        """The channel that answers most."""
        return int(np.argmax(self.counts[self.row()] - self.counts[0]))
