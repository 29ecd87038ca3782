"""A rig, a plan and a press with known answers, for the tests of the recording room."""

from dataclasses import replace

import numpy as np

from tacdata.clock import Clock
from tacdata.devices.device import CncStatus, StreamCounts, TaxelFrame
from tacdata.plans import Plan
from tacdata.recording import read_session
from tacdata.recording.clocks import envelope_fit
from tacdata.recording.files import file_names
from tacdata.recording.files.writer import CubePoseRecord, EpisodeWriter, Header
from tacdata.recording.motion.move_times import Command
from tacdata.recording.motion.press_steps import steps
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.recording.recorder import Recorder
from tacdata.recording.session import create_session, refresh
from tacdata.rig import read_rig
from tacdata.rig import rig as rig_file
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.world.mounting import mount

T0 = 1_760_000_000_000_000_000
LIMITS = AxisLimits(np.array([200.0, 200.0, 100.0]), np.array([50.0, 50.0, 20.0]))
SENSOR = default_sensor()
INTRINSICS = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0}
CUBE = {"side": 20.0, "tag": 16.0, "ids": {"+x": 0, "-x": 1, "+y": 2, "-y": 3, "+z": 4}}


def rig_document(camera=False, **changes):
    document = {
        "version": "1.0",
        "name": "bench",
        "cnc": {"driver": "grbl", "port": "/dev/null"},
        "board": {"driver": "capacitive_board", "port": "/dev/null"},
        "registration": {"origin": [10.0, 20.0, -30.0], "yaw": 5.0, "method": "by hand", "date": "2026-01-01"},
        "envelope": {"min": [0.0, 5.0, -33.0], "max": [25.0, 35.0, 0.0]},
    }
    if camera:
        entry = {"driver": "opencv_camera", "source": 0, "intrinsics": INTRINSICS, "cube": CUBE}
        document["cameras"] = {"side": entry}
    return {**document, **changes}


def rig(**changes):
    return rig_file.from_document(rig_document(**changes), "bench")


def plan_document(presses=2, **motion):
    sites = [(1.0, 0.5), (-2.0, 1.5), (3.0, -2.0), (0.0, 0.0), (-4.0, -3.0), (4.0, 3.0)]
    settings = {
        "clearance": 3.0,
        "standoff": 0.3,
        "travel_speed": 20.0,
        "approach_speed": 5.0,
        "press_speed": 1.0,
        "hold": 0.6,
        "rest": 1.0,
    }
    return {
        "version": "1.0",
        "name": "two",
        "indenters": {"ball": {"shape": "sphere", "radius": 3.0}},
        "motion": {**settings, **motion},
        "presses": [
            {"indenter": "ball", "x": sites[k % 6][0], "y": sites[k % 6][1], "depth": 0.8 + 0.02 * k}
            for k in range(presses)
        ],
    }


def plan(presses=2, **motion):
    return Plan.from_document(plan_document(presses, **motion), "two")


def recorder(virtual, out, **options):
    """A recorder of two presses, or those of the `plan` given, on an emulated rig."""
    bench = read_rig(virtual.path)
    return Recorder(
        bench,
        SENSOR,
        options.pop("plan", plan(2)),
        out,
        mount=lambda press: mount(bench.document, press.indenter.document, press.yaw),
        **options,
    )


def header(number=0, camera=False):
    of = plan(number + 1)
    board = {"channels": 24, "rate": {"nominal": 30.0, "unit": "Hz"}}
    controller = {
        "settings": {"banner": "test"},
        "acceleration": LIMITS.acceleration.tolist(),
        "max_rate": LIMITS.max_rate.tolist(),
    }
    return Header(of.presses[number], SENSOR, rig_document(camera), of.document, board, controller)


class Press:
    """What a perfect rig does in one press, and what its streams then say; edit it to plant faults."""

    def __init__(self, number=0, seed=0, rate=30.0, camera=False, of=None):
        self.rng, self.number, self.camera = np.random.default_rng([seed, number]), number, camera
        self.header = of or header(number, camera)
        bench = rig(camera=camera)
        self.commands, self.path = [], []
        self._carry_out(bench)
        self.end = self.commands[-1].acknowledged_ns + 100_000_000
        self.sample = T0 + np.arange(0, self.end - T0, round(1e9 / rate))
        self.counter = np.arange(len(self.sample)) + 500
        self.arrival = self.sample + self.rng.integers(1_000_000, 6_000_000, len(self.sample))
        self.counts = self._counts(bench.registration.to_sensor(self.position(self.sample)))
        sent = np.arange(T0, self.end, 125_000_000)
        self.statuses = [
            CncStatus(int(t), int(t) + 8_000_000, "Run", self.report(int(t) + 4_000_000), 0.0) for t in sent
        ]
        self.views = [(int(t) + 20_000_000, k) for k, t in enumerate(sent)] if camera else []

    def _carry_out(self, bench):
        now, at = T0 + 50_000_000, np.array([10.0, 20.0, -27.0])
        for step in steps(self.header.press, plan().motion, bench.registration):
            target = np.array(step.target) if step.target else at
            sent = now
            if step.target:
                move = LIMITS.straight_move(at, target, step.speed)
                self.path.append((sent + 3_000_000, move))
                acknowledged = sent + 6_000_000
                self.free = sent + 3_000_000 + round(move.duration * 1e9)
            else:
                acknowledged = max(self.free, now) + round(step.seconds * 1e9) + 4_000_000
            self.commands.append(Command(step.phase, at, target, step.speed, step.seconds, sent, acknowledged, "G1"))
            now, at = acknowledged + 1_000_000, target

    def report(self, time_ns):
        """What the controller reports [mm], shape (3,): three decimals."""
        return np.round(self.position(np.array([time_ns]))[0], 3)

    def position(self, time_ns):
        """True machine position [mm], shape (n, 3)."""
        result = np.tile(self.path[0][1].start, (len(time_ns), 1))
        for start, move in self.path:
            share = move.distance((time_ns - start) / 1e9) / max(move.length, 1e-12)
            begun = time_ns >= start
            result[begun] = (move.start + share[:, None] * (move.target - move.start))[begun]
        return result

    def _counts(self, tip):
        apart = np.linalg.norm(SENSOR.taxels.centers[None] - tip[:, None, :2], axis=-1)
        answer = 2500 * np.maximum(tip[:, 2:], 0.0) * np.exp(-(apart**2) / 8)
        return np.round(9000 + answer + self.rng.normal(0, 5, answer.shape))

    def drop(self, first, last):
        """Lose the frames in [first, last)."""
        kept = np.ones(len(self.sample), bool)
        kept[first:last] = False
        for name in ("sample", "counter", "arrival", "counts"):
            setattr(self, name, getattr(self, name)[kept])

    def write(self, path, complete=True, reason=""):
        """Write the recording; returns its path."""
        writer = EpisodeWriter(path, self.header, Clock(T0, 0, 1.0), ("side",) if self.camera else ())
        self.feed(writer)
        model = envelope_fit.fit(self.arrival, self.counter)
        models = {"taxels": model} if model else {}
        counts = {"taxels": StreamCounts(received=len(self.sample))}
        return writer.close(complete, reason, models, counts)

    def feed(self, writer):
        for k in range(len(self.sample)):
            writer.taxels(TaxelFrame(int(self.arrival[k]), int(self.counter[k]), self.counts[k]), int(self.sample[k]))
        for status in self.statuses:
            writer.status(status)
        for command in self.commands:
            writer.motion(command)
        for time, k in self.views:
            writer.image("side", time, time, k, b"jpeg %d" % k)
            pose = CubePoseRecord((0.1, 0.2, 0.4 + 1e-6 * k), (0.0, 0.6, 0.0, 0.8), 0.25, 2) if k % 3 else None
            writer.cube("side", time, time, k, pose)


def pressed(path, number=0, shift=0.0, off=0.0):
    """A recording of a skin that begins so far below depth zero [mm]; the guide reports so much deeper at rest."""
    press = Press(number)
    tip = rig().registration.to_sensor(press.position(press.sample))
    press.counts = press._counts(tip - [0.0, 0.0, shift])
    lowest = min(status.position[2] for status in press.statuses)
    press.statuses = [
        replace(status, position=status.position - [0.0, 0.0, off]) if status.position[2] < lowest + 1e-3 else status
        for status in press.statuses
    ]
    return press.write(path)


def session_of(folder, shifts, off=0.0):
    """A session of such presses."""
    create_session(folder, plan(len(shifts)), SENSOR, rig().document)
    for number, shift in enumerate(shifts):
        pressed(file_names.episode(folder, number), number, shift, off)
    return refresh(read_session(folder))
