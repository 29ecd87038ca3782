"""Faults planted in clean sessions, by kind and size: which of them does `tacdata check` find?

Prints a table for `benchmarks/README.md`: the share found with Wilson's interval at 95 %, and the area under the ROC
curve of a score (reasons why it is unusable count ten, warnings one) against the clean sessions.

``python benchmarks/check_faults.py --trials 4 --clean 100``; a fault that concerns one recording changes only that one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import binomtest, rankdata

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "recording"))
from recording_examples import SENSOR, T0, Press, plan_document, rig, rig_document

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts
from tacdata.plans import Plan
from tacdata.recording.check.figures import figures
from tacdata.recording.check.findings import UNUSABLE, findings
from tacdata.recording.check.session import session_findings
from tacdata.recording.clocks import envelope_fit
from tacdata.recording.clocks.polled_clock import polled_clock
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.writer import EpisodeWriter, Header

PRESSES, RATE, MS = 24, 30.0, 1_000_000
BOARD = {"channels": 24, "rate": {"nominal": RATE, "unit": "Hz"}, "format": {"channels": {"type": "uint16"}}}


def plan_of(seed):
    """Return a plan of `PRESSES` presses at drawn sites and depths."""
    rng = np.random.default_rng([seed, 1])
    document = plan_document(1)
    document["presses"] = [
        {"indenter": "ball", "x": round(x, 2), "y": round(y, 2), "depth": round(depth, 2)}
        for x, y, depth in rng.uniform([-4.7, -3.7, 0.6], [4.7, 3.7, 1.0], (PRESSES, 3))
    ]
    return Plan.from_document(document, "drawn")


class Recorded(Press):
    """One press of a session, as a perfect rig records it; faults change its attributes."""

    def __init__(self, plan, number, seed):
        self.rng, self.number, self.camera = np.random.default_rng([seed, number]), number, False
        example = Press(0).header
        controller = {**example.controller}
        self.header = Header(plan.presses[number], SENSOR, rig_document(), plan.document, dict(BOARD), controller)
        self.bench, self.commands, self.path = rig(), [], []
        self._carry_out(self.bench)
        self.end = self.commands[-1].acknowledged_ns + 100 * MS
        self.gain = np.random.default_rng([seed, 2]).normal(1, 0.08, 24)
        self.driver, self.complete = StreamCounts(), True
        self.sampled(RATE)
        sent = np.arange(T0, self.end, 125 * MS)
        self.statuses = [
            CncStatus(int(t), int(t) + 8 * MS, "Run", self.report(int(t) + 4 * MS), 0.0) for t in sent
        ]
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
        self.counts = np.round(9000 + self.gain * (self._counts(tip) - 9000))

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


KINDS = {}
ONE, LATER, ALL = "one", "later", "all"
"""Which presses a fault concerns."""


def kind(group, sizes, whole=ONE):
    """Register ``plant(press, size, rng)`` with three sizes, for one press, for all, or for the second half."""

    def keep(plant):
        KINDS[plant.__name__.replace("_", " ")] = plant, group, sizes, whole
        return plant

    return keep


@kind("drops", (1, 5, 20))
def frames_lost(p, size, rng):
    """Lose frames; the counter shows it."""
    p.drop(60, 60 + size)


@kind("drops", (8, 15, 30))
def frames_lost_without_a_gap_in_the_counter(p, size, rng):
    """Lose frames before they are counted."""
    p.drop(60, 60 + size)
    p.counter = np.arange(len(p.sample)) + 500


@kind("repeats", (1, 5, 20))
def frames_twice(p, size, rng):
    """Store frames twice."""
    again = np.sort(np.concatenate([np.arange(len(p.sample)), np.arange(60, 60 + size)]))
    for name in ("sample", "counter", "arrival", "counts"):
        setattr(p, name, getattr(p, name)[again])


@kind("repeats", (5, 15, 45))
def values_held(p, size, rng):
    """Hold all readings for some frames."""
    p.counts[p.row() : p.row() + size] = p.counts[p.row()]


@kind("channels", (15, 30, 400))
def channel_sticks(p, size, rng):
    """Hold one channel from the hold on."""
    p.counts[p.row() : p.row() + size, p.strongest] = p.counts[p.row(), p.strongest]


@kind("channels", (1, 2, 6), whole=ALL)
def channels_swapped(p, size, rng):
    """Swap pairs of channels."""
    pairs = rng.permutation(24)[: 2 * size].reshape(-1, 2)
    order = np.arange(24)
    order[pairs[:, 0]], order[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    p.counts = p.counts[:, order]


@kind("channels", (1.5, 2.0, 4.0), whole=LATER)
def channel_rescaled(p, size, rng):
    """Rescale the answer of one channel."""
    channel = int(rng.integers(24))
    p.counts[:, channel] = np.round(9000 + size * (p.counts[:, channel] - 9000))


@kind("channels", (1.3, 1.6, 2.5), whole=LATER)
def all_rescaled(p, size, rng):
    """Rescale all answers."""
    p.counts = np.round(9000 + size * (p.counts - 9000))


@kind("channels", (0, 1, 2), whole=ALL)
def plug_turned(p, size, rng):
    """Turn or mirror the array."""
    grid = np.arange(24).reshape(SENSOR.taxels.rows, -1)
    p.counts = p.counts[:, (grid[::-1, ::-1], grid[:, ::-1], grid[::-1])[size].ravel()]


@kind("channels", (1, 3, 8), whole=LATER)
def dead_channels(p, size, rng):
    """Let channels stand still."""
    p.counts[:, rng.permutation(24)[:size]] = 9000


@kind("channels", (1, 2, 5))
def channels_tied(p, size, rng):
    """Let pairs of channels read the same."""
    pairs = rng.permutation(24)[: 2 * size].reshape(-1, 2)
    p.counts[:, pairs[:, 0]] = p.counts[:, pairs[:, 1]]


@kind("time", (60, 150, 400))
def taxels_late(p, size, rng):
    """Let readings come late [ms]."""
    p.felt(late_ns=size * MS)


@kind("time", (60, 150, 400))
def motion_late(p, size, rng):
    """Let the motion come late [ms]."""
    p.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, p.report(s.sent_ns + (4 - size) * MS), s.feed) for s in p.statuses
    ]
    p.felt(late_ns=size * MS)


@kind("time", (400, 1000, 3000))
def clock_drifts(p, size, rng):
    """Let the board's clock drift [ppm]."""
    p.sampled(RATE / (1 + size * 1e-6))


@kind("time", (60, 150, 500))
def clock_steps(p, size, rng):
    """Let the board's clock step [ms]."""
    later = (np.arange(len(p.sample)) >= 60) * size * MS
    p.sample, p.arrival = p.sample + later, p.arrival + later


@kind("time", (3, 10, 40))
def rate_is_wrong(p, size, rng):
    """Sample more slowly than said [%]."""
    p.sampled(RATE * (1 - size / 100))


@kind("time", (300, 700, 1500))
def host_stalls(p, size, rng):
    """Let the computer stand still [ms]."""
    begin = int(p.arrival[60])
    p.arrival = np.where((p.arrival >= begin) & (p.arrival < begin + size * MS), begin + size * MS, p.arrival)


@kind("time", (0.5, 2.0, 5.0))
def taxels_end_early(p, size, rng):
    """End the readings early [s]."""
    p.drop(int(np.searchsorted(p.sample, p.end - size * 1e9)), len(p.sample))


@kind("readings", (0.9, 0.7, 0.4))
def saturation(p, size, rng):
    """Limit all answers [share of the peak]."""
    peak = (p.counts - 9000).max()
    p.counts = np.minimum(p.counts, np.round(9000 + size * peak))


@kind("readings", (6, 12, 30))
def channel_noisy(p, size, rng):
    """Add noise to one channel [times its own]."""
    p.counts[:, int(rng.integers(24))] += np.round(rng.normal(0, 5 * size, len(p.counts)))


@kind("readings", (4, 10, 30), whole=LATER)
def all_noisy(p, size, rng):
    """Add noise to all channels [times their own]."""
    p.counts = p.counts + np.round(rng.normal(0, 5 * size, p.counts.shape))


@kind("readings", (1, 10, 100))
def no_numbers(p, size, rng):
    """Let readings be no numbers."""
    p.counts[60 : 60 + size, int(rng.integers(24))] = np.nan


@kind("readings", (100, 400, 1500))
def channel_jumps_in_the_hold(p, size, rng):
    """Shift one channel in the hold [counts]."""
    p.counts[p.row() :, int(rng.integers(24))] += size


@kind("readings", (100, 400, 1500))
def supply_steps(p, size, rng):
    """Shift all channels in the hold [counts]."""
    p.counts[p.row() :] += size


@kind("readings", (300, 1000, 5000))
def spikes(p, size, rng):
    """Add three spikes to one channel [counts]."""
    p.counts[p.row() + np.array([-5, 0, 5]), int(rng.integers(24))] += size


@kind("contact", (1.0, 2.0, 4.0), whole=LATER)
def tool_slips_sideways(p, size, rng):
    """Shift the tool sideways from mid-session on [mm]."""
    p.felt(x=size)


@kind("contact", (0.2, 0.4, 0.8), whole=LATER)
def tool_slips_up(p, size, rng):
    """Shift the tool up from mid-session on [mm]."""
    p.felt(up=size)


@kind("contact", (1.0, 2.0, 4.0), whole=LATER)
def labels_of_another_place(p, size, rng):
    """Write another place into the label [mm away]."""
    document = {**p.header.press.document}
    document["x"] = document["x"] - size * np.sign(document["x"] or 1.0)
    object.__setattr__(p.header, "press", type(p.header.press).from_document(document))


@kind("controller", (0.06, 0.15, 0.4))
def guide_stops_short(p, size, rng):
    """Let the guide stop short [mm]."""
    lowest = min(s.position[2] for s in p.statuses)
    p.statuses = [
        CncStatus(s.sent_ns, s.arrival_ns, s.state, np.maximum(s.position, [-99, -99, lowest + size]), s.feed)
        for s in p.statuses
    ]


@kind("controller", (16, 32, 1000))
def reports_missing(p, size, rng):
    """Lose status reports."""
    middle = len(p.statuses) // 2
    p.statuses = p.statuses[: max(middle - size // 2, 0)] + p.statuses[middle + size // 2 :]


@kind("controller", (1, 3, 10))
def alarm(p, size, rng):
    """Report an alarm."""
    for k in range(30, 30 + size):
        s = p.statuses[k]
        p.statuses[k] = CncStatus(s.sent_ns, s.arrival_ns, "Alarm:1", s.position, s.feed)


@kind("line", (1, 10, 100))
def damaged_frames(p, size, rng):
    """Discard damaged frames."""
    p.driver.corrupt = size
    p.drop(60, 60 + max(size // 10, 1))


class Clean:
    """A clean session, whose figures are computed once."""

    def __init__(self, seed, folder):
        self.seed, self.folder, self.plan = seed, folder / f"clean-{seed}", plan_of(seed)
        self.folder.mkdir()
        self.entries = [self.press(number).written(self.folder) for number in range(PRESSES)]
        self.score = score(self.entries)

    def press(self, number):
        """Return one press as recorded, still clean."""
        return Recorded(self.plan, number, self.seed)

    def with_fault(self, plant, size, whole, trial):
        """Return the score of this session with a fault in it."""
        entries = list(self.entries)
        first = {LATER: PRESSES // 2, ALL: 0}
        numbers = range(first[whole], PRESSES) if whole in first else [trial % PRESSES]
        for number in numbers:
            press = self.press(number)
            plant(press, size, np.random.default_rng([self.seed, trial]))
            entries[number] = press.written(self.folder)
        return score(entries)


def score(entries):
    """Return ten for each reason why a session is unusable, and one for each warning."""
    found = [*(f for entry in entries for f in findings(entry)), *session_findings(entries)]
    return sum(10 if f.severity == UNUSABLE else 1 for f in found)


def interval(found, of):
    """Return the share found with Wilson's interval, as text."""
    low, high = binomtest(found, of).proportion_ci(method="wilson")
    return f"{100 * found / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def area(faulty, clean):
    """Return the area under the ROC curve [1]."""
    ranks = rankdata([*faulty, *clean])[: len(faulty)].sum()
    return (ranks - len(faulty) * (len(faulty) + 1) / 2) / (len(faulty) * len(clean))


def main():
    """Run it and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=4, help="sessions per kind and size")
    parser.add_argument("--clean", type=int, default=100, help="clean sessions")
    parser.add_argument("--kinds", nargs="*", help="only these kinds, with _ for blanks")
    given = parser.parse_args()
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        clean = [Clean(seed, Path(folder)) for seed in range(given.clean)]
        scores = [session.score for session in clean]
        print(f"clean sessions with a remark: {interval(sum(s > 0 for s in scores), len(scores))}", flush=True)
        print("| fault | of | small | middle | large | found | AUC |\n|---|---|---|---|---|---|---|")
        everything = []
        for name, (plant, group, sizes, whole) in KINDS.items():
            if given.kinds and name.replace(" ", "_") not in given.kinds:
                continue
            table = [
                [clean[t].with_fault(plant, size, whole, t) for t in range(given.trials)] for size in sizes
            ]
            cells = [f"{sum(s > 0 for s in row)} of {len(row)}" for row in table]
            faulty = [value for row in table for value in row]
            everything += faulty
            share, auc = interval(sum(s > 0 for s in faulty), len(faulty)), area(faulty, scores)
            sized = " / ".join(f"{size:g}" for size in sizes)
            print(f"| {name} ({sized}) | {group} | {' | '.join(cells)} | {share} | {auc:.2f} |", flush=True)
        print(f"all: AUC {area(everything, scores):.3f}; {time.process_time() - begin:.0f} s of a core")


if __name__ == "__main__":
    main()
