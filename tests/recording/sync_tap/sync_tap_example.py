"""A sync tap with known answers: the emulated skin, a link of known delay and a camera of known delay."""

from dataclasses import replace

import numpy as np
from recording_examples import SENSOR, T0, Press, header, plan

from tacdata.devices.device import CncStatus
from tacdata.recording.files.writer import CubePoseRecord
from tacdata.recording.motion import sync_tap
from tacdata.recording.motion.move_times import Command
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.rig import Registration
from tacdata.virtual_rig.world.world import World, draw

MS = 1_000_000
CAMERA_DELAY = 0.045


class Tap(Press):
    """What a rig does in a sync tap, and what its streams then say; ``true`` holds the true sample times."""

    def __init__(self, seed=0, rate=30.0, delay=0.006, timer=0.0, drift=60.0, acceleration=150.0, camera=False):
        self.rng, self.number, self.camera = np.random.default_rng([seed, 77]), 0, camera
        self.registration = Registration((10.0, 20.0, -30.0), 5.0)
        self.limits = AxisLimits(np.array([200.0, 200.0, acceleration]), np.array([50.0, 50.0, 15.0]))
        of = plan(1)
        self.press = sync_tap.touch(of, SENSOR)
        controller = {
            "settings": {},
            "acceleration": self.limits.acceleration.tolist(),
            "max_rate": self.limits.max_rate.tolist(),
        }
        self.header = replace(header(0, camera), press=self.press, controller=controller)
        self.commands, self.path, self.views = [], [], []
        self._touch(sync_tap.steps(self.press, of, self.registration))
        self._sample(seed, rate, delay, timer, drift)
        self._report()
        if camera:
            self._watch()

    def _touch(self, steps):
        now, at = T0 + 10_000_000_000, np.array([10.0, 20.0, -27.0])
        for step in steps:
            target, begun = np.array(step.target) if step.target else at, self._some(4, 5)
            if step.target:
                move = self.limits.straight_move(at, target, step.speed)
                self.path.append((now + begun, move))
                self.free = now + begun + round(move.duration * 1e9)
                acknowledged = now + begun + self._some(0.8, 5)
            else:
                acknowledged = max(self.free, now) + round(step.seconds * 1e9) + self._some(1, 6)
            self.commands.append(Command(step.phase, at, target, step.speed, step.seconds, now, acknowledged, "G1"))
            now, at = acknowledged + 500_000, target
        self.end = now + 100 * MS

    def _some(self, low, high):
        return int(self.rng.uniform(low, high) * MS)

    def _sample(self, seed, rate, delay, timer, drift):
        count = int((self.end - T0) / 1e9 * rate)
        period = 1e9 / rate * (1 + drift * 1e-6)
        self.true = T0 + self._some(0, 30) + np.rint(np.arange(count) * period).astype(np.int64)
        self.counter = np.arange(count) + 500
        arrival = self.true + np.rint((delay + self.rng.exponential(0.0005, count)) * 1e9).astype(np.int64)
        if timer:
            tick = round(timer * 1e9)
            arrival = T0 + -(-(arrival - T0) // tick) * tick
        self.arrival = np.maximum.accumulate(arrival)
        self.sample = self.arrival
        world = World(draw(seed, SENSOR, self.registration), SENSOR)
        tips = self.position(self.true)
        self.counts = np.array(
            [world.readings(tip, self.press.indenter, 0.0, int(t)) for tip, t in zip(tips, self.true, strict=True)]
        )

    def _report(self):
        self.statuses = []
        for sent in range(T0, self.end, 125 * MS):
            trip = self._some(2, 12)
            at = sent + int(self.rng.uniform(0.2, 0.8) * trip)
            self.statuses.append(CncStatus(sent, sent + trip, "Run", self.report(at), 0.0))

    def _watch(self):
        exposed = np.arange(T0 + 7 * MS, self.end, 33_333_333)
        arrival = exposed + round(CAMERA_DELAY * 1e9) + self.rng.integers(0, 4 * MS, len(exposed))
        place = self.position(exposed) @ np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, -0.6]])
        place = place + self.rng.normal(0, 0.15, place.shape)
        self.exposed, self.views = exposed, list(zip(arrival.tolist(), place.tolist(), strict=True))

    def feed(self, writer):
        views, self.views = self.views, []
        super().feed(writer)
        for k, (arrival, place) in enumerate(views):
            writer.image("side", arrival, arrival, k, b"jpeg")
            pose = CubePoseRecord(tuple(v / 1e3 for v in place), (0.0, 0.6, 0.0, 0.8), 0.25, 2)
            writer.cube("side", arrival, arrival, k, pose)
        self.views = views
