"""A rig in a simulated world: the emulated controller, a board, and what truly happened."""

from dataclasses import replace

import numpy as np
from schedule import SECOND, Schedule
from simulated_camera import CameraDevice, SimulatedCamera
from simulated_disk import SimulatedDisk
from simulated_host import EPOCH, START, SimulatedHost
from simulated_line import LINES, SimulatedLine

from tacdata.clock import Clock
from tacdata.plans import Plan
from tacdata.recording.live.ending import ending
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.lost_position import PositionGuard
from tacdata.recording.live.machine_state import UNKNOWN, MachineState
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.recording.recorder import Recorder
from tacdata.registration import RegistrationSettings
from tacdata.registration.guarded_probe import guarded_probe
from tacdata.registration.procedure import register
from tacdata.rig.rig import from_document
from tacdata.sensor import default_sensor
from tacdata.virtual_rig.board import Timing, VirtualBoard
from tacdata.virtual_rig.firmware.controller import Controller
from tacdata.wire import default_format

SENSOR = default_sensor()
ORIGIN, PARKED = (-96.0, -61.5, -38.0), 12.0
CLEARANCE = 3.0
ENVELOPE = {"min": [-106.0, -76.5, -41.0], "max": [-86.0, -46.5, -20.0]}
SITES = [(1.0, 0.5), (-2.0, 1.5), (3.0, -2.0), (0.0, 0.0)]
SPREAD = 3.0
"""Distance from the tip at which a taxel answers with 0.6 of its greatest answer [mm]."""
WATCHED = 0.01
"""How often the true position is noted [s]."""
LIMIT = 180.0
"""Time after which a run counts as hung [s]; two presses without faults take about 25 s."""


def plan(presses, tools=False, **entries):
    """Return a plan of some seconds a press, each by another tool if there are ``tools``, with further entries."""
    spheres = ("ball", "pin") if tools else ("ball",)
    return Plan.from_document(
        {
            "version": "1.0",
            "name": "simulated",
            "indenters": {
                name: {"shape": "sphere", "radius": radius} for name, radius in zip(spheres, (3.0, 2.0), strict=False)
            },
            "motion": {
                "clearance": CLEARANCE,
                "standoff": 0.3,
                "travel_speed": 20.0,
                "approach_speed": 5.0,
                "press_speed": 0.5,
                "hold": 2.0,
                "rest": 1.0,
            },
            "presses": [
                {"indenter": spheres[k % len(spheres)], "x": x, "y": y, "depth": 0.8 + 0.1 * (k % 4)}
                for k, (x, y) in enumerate((SITES * presses)[:presses])
            ],
            **entries,
        },
        "simulated",
    )


class Calm:
    """No fault, as the judge of a run sees it."""

    deaf, names, stalls = False, (), ()

    def due(self):
        """Return that nothing has to end the run."""

    def seen(self, cameras=True):
        """Return that there is nothing to see."""


class World:
    """One computer, one controller, one board and their lines, driven by one seed."""

    def __init__(
        self,
        seed,
        folder,
        presses=2,
        firmware="Grbl",
        settings=None,
        echo=False,
        camera=False,
        zero=False,
        speed=1.0,
        tools=False,
        **entries,
    ):
        """Switch everything on; with ``zero`` the place where a controller counts from lies in the envelope.

        The rig's clock runs ``speed`` times as fast as the computers'.
        """
        self.envelope = {**ENVELOPE, "max": [1.0, 1.0, 1.0]} if zero else ENVELOPE
        self.tools = tools
        self.seed, self.folder, self.plan = seed, folder, plan(presses, tools, **entries)
        self.limit = max(LIMIT, LIMIT / 6 * presses)
        self.schedule = Schedule(seed, self.limit)
        self.bench = SimulatedHost(self.schedule)
        self.clock = Clock(EPOCH + START, START, speed, self.bench)
        self.computer = self._boot()
        names = [f"sim://{seed}/{device}" for device in ("cnc", "board")]
        self.cnc_line = SimulatedLine(names[0], self.computer, self.bench, 115200)
        self.board_line = SimulatedLine(names[1], self.computer, self.bench, 115200)
        parked = (ORIGIN[0], ORIGIN[1], ORIGIN[2] + PARKED)
        self.controller = Controller(
            self.clock, seed, parked, settings=settings, firmware=firmware, port=self.cnc_line, echo=echo
        )
        timing = Timing(self.clock.now_ns(), 1 / 30, 20.0, 0.0003, 600.0, 0.001, 0.016)
        self.board = VirtualBoard(self.clock, default_format(), timing, self._read, 115200, seed, self.board_line)
        self._noise = np.random.default_rng([seed, 1])
        self._taxels = np.array([self.rig().registration.to_machine(x, y, 0.0)[:2] for x, y in SENSOR.taxels.centers])
        self.path = []
        """(time [s], true position [mm] as x, y, z, whether it moves, whether its position is truly lost)."""
        self.stops = []
        """Times at which the recorder stopped the motion [s]."""
        self.drives, self.warned = [], []
        """(begin, end) of each path of the guide, and when a person read that the tip was not lifted [s]."""
        self._awaited, self.mounted = [], []
        self.raised = 0.0
        """Height of the skin above the registered one [mm]."""
        self.camera = CameraDevice() if camera else None
        self.asked, self.answer, self.said = [], lambda question: False, []
        self.is_new = True  # who sets a machine up answers where it stands
        self.controller.start()
        self.board.start()
        self.bench.thread(self._watch, "watch").start()

    def _boot(self):
        host = SimulatedHost(self.schedule)
        host.disk = SimulatedDisk(host)
        return host

    def reboot(self):
        """Start the computer's process anew, after it ended or was killed."""
        self.computer.kill()
        before, self.computer = self.computer, self._boot()
        self.computer.preempt, self.computer.lateness = before.preempt, before.lateness
        for line in (self.cnc_line, self.board_line):
            line.attach(self.computer)
        self.schedule.extend(self.limit)

    def register(self):
        """Register the sensor as `tacdata register` does; return what was found, or raise what it raises."""
        rig = self.rig()

        def work():
            with Interruption(self.computer) as interruption:
                devices = RigDevices.of(rig)
                state = MachineState(rig, devices.cnc)
                guard = PositionGuard(state, devices.cnc, self._asked)
                motion = self._noted(GuardedMotion(devices.cnc, rig.clock, interruption, state))
                try:
                    guard.before_homing(resumed=False)
                    with guard.opened(devices):
                        guard.require_known(ORIGIN[2] + CLEARANCE)
                        where = rig, devices, ORIGIN[2] + CLEARANCE, 5.0, interruption, motion, self._say
                        with guarded_probe(*where) as probe:
                            return register(probe, SENSOR, rig.registration, RegistrationSettings())
                except BaseException as error:
                    interruption.last_words()
                    data = ("nothing was written",)
                    error.add_note(ending(motion, guard.loss(), data, "the same command", error))
                    raise

        return self.computer.run(work)

    def _noted(self, motion):
        stop, drive = motion.stop, motion.drive

        def driven(*path):
            begun = self.schedule.now
            try:
                return drive(*path)
            finally:
                self.drives.append((begun, self.schedule.now))

        motion.stop = lambda: (self.stops.append(self.schedule.now), stop())
        motion.drive = driven
        return motion

    def _say(self, words):
        self.said.append(words)
        if "not lifted" in words:
            self.warned.append(self.schedule.now)

    def _mount(self, press):
        """Change the tool, as a person does; the guide stands still meanwhile."""
        begun = self.position()
        self.computer.sleep(4.0)
        self.mounted.append((press.indenter_name, begun, self.position()))

    def record(self, resume=False, sync_tap=False, confirmed="", prove=None, **controller):
        """Run the recorder, with settings of the controller; return the session, or raise what it raises."""
        rig = self.rig(**controller)
        devices = RigDevices.of(rig)
        if self.camera:
            devices = replace(devices, cameras={"side": SimulatedCamera(rig.clock, self.camera)})

        def work():
            with Interruption(self.computer) as interruption:
                recorder = Recorder(
                    rig,
                    SENSOR,
                    self.plan,
                    self.folder,
                    resume,
                    devices,
                    interruption=interruption,
                    ask=self._asked,
                    say=self._say,
                    sync_tap=sync_tap,
                    confirmed=confirmed,
                    prove=prove,
                    mount=self._mount if self.tools else None,
                )
                self._noted(recorder._motion)
                return recorder.run(lambda summary: True)

        return self.computer.run(work)

    def rig(self, **controller):
        """Return the rig as its file describes it, on this computer's clock."""
        document = {
            "version": "1.0",
            "name": "simulated",
            "cnc": {"driver": "grbl", "port": self.cnc_line.path, **controller},
            "board": {"driver": "capacitive_board", "port": self.board_line.path},
            "registration": {"origin": [*ORIGIN], "yaw": 5.0, "method": "by hand", "date": "2026-01-01"},
            "envelope": self.envelope,
            "state_directory": str(self.folder.parent / "machines"),
        }
        clock = Clock(EPOCH + START, START, self.clock.rate, self.computer)
        return replace(from_document(document, "simulated"), clock=clock)

    def repair(self, lost, unlocks=False):
        """Do what a person does: plug in, close the door, make room; return that nothing is wrong any more.

        If the position is ``lost`` the controller is switched off and on, or only unlocked ($X).
        """
        for line in (self.cnc_line, self.board_line):
            line.plug_in()
        self.controller.inject_wire(lambda line: line, lambda text: text)
        self.controller.inject_door(False)
        if lost and unlocks:
            self.controller.machine.reset(self.clock.now_ns())
            self.controller.machine.alarm = None
        elif lost:
            self.controller.inject_brown_out()
        self.mend_board()
        if self.camera:
            self.camera.repair()
        self.schedule.run_for(3.0, self.bench)
        return Calm()

    def mend_board(self):
        """Let the board read what is there again."""
        self.board.inject_readings(lambda counts: self._read(self.clock.now_ns()))

    def home(self):
        """Find the position again, as homing or a touch-off does."""
        machine = self.controller.machine
        machine.error, machine.alarm = np.zeros(3), None

    def end(self):
        """End everything."""
        for host in (self.computer, self.bench):
            host.kill()
        for line in (self.cnc_line, self.board_line):
            LINES.pop(line.path)

    @property
    def lost(self):
        """Whether the controller counts from elsewhere than where it stands."""
        return bool(np.abs(self.controller.machine.error).max() > 0.05)

    def position(self):
        """Return where the tip truly is [mm], shape (3,)."""
        return self.controller.position_at(self.clock.now_ns())

    def _asked(self, question):
        is_new, self.is_new = self.is_new, False
        if is_new and UNKNOWN in question:
            return True
        self.asked.append(question)
        return self.answer(question)

    def _read(self, sampled_ns):
        tip = self.controller.position_at(sampled_ns)
        depth = max(ORIGIN[2] + self.raised - tip[2], 0.0)
        far = ((self._taxels - tip[:2]) ** 2).sum(axis=1) / SPREAD**2
        return np.round(9000 + 800 * depth * np.exp(-far / 2) + self._noise.normal(0, 5, 24))

    def when_down_at(self, height, action, after=0.0):
        """Do something so many seconds after the tip is first down at a machine height [mm]."""
        self._awaited.append((height, action, after))

    def _watch(self):
        while True:
            now = self.clock.now_ns()
            x, y, z = self.controller.position_at(now).tolist()
            for reached in [entry for entry in self._awaited if z <= entry[0]]:
                self._awaited.remove(reached)
                self.schedule.at(self.schedule.now_ns + round(reached[2] * SECOND), reached[1])
            self.path.append((self.schedule.now_ns / SECOND, x, y, z, self.controller.planner.moving(now), self.lost))
            self.bench.sleep(WATCHED)
