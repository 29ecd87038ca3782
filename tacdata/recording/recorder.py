"""Drives a rig through a plan and records every press; on any fault the motion stops first."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from tacdata.devices.device import OwesAnswer
from tacdata.errors import DeviceError, TacdataError, UsageError
from tacdata.plans import Plan, Press
from tacdata.recording.clocks.clock_model import StreamLatency
from tacdata.recording.files import file_names
from tacdata.recording.files.reader import read_recording
from tacdata.recording.files.writer import EpisodeWriter, Header
from tacdata.recording.live.detection_process import Detect
from tacdata.recording.live.ending import ending, on_disk
from tacdata.recording.live.guarded_motion import WATCH, GuardedMotion
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.live_feed import Watch
from tacdata.recording.live.lost_position import Ask, PositionGuard
from tacdata.recording.live.machine_state import MachineState
from tacdata.recording.live.pressed_depth import require_contact
from tacdata.recording.live.reading_health import BadReadings
from tacdata.recording.live.rig_devices import RigDevices, require_channels
from tacdata.recording.live.rig_streams import RigStreams
from tacdata.recording.motion import sync_tap as tap_motion
from tacdata.recording.motion.preflight import Preflight, preflight, safe_height
from tacdata.recording.motion.press_steps import Position, Step, steps, with_safe_travel
from tacdata.recording.motion.trapezoid import AxisLimits
from tacdata.recording.session import Session, create_session, refresh, resume_session
from tacdata.recording.sync_tap import delays
from tacdata.recording.sync_tap.session_delays import add_sync, changes, latencies
from tacdata.rig import Rig
from tacdata.sensor import Sensor
from tacdata.wire.patience import Patience

Prove = Callable[..., Position]
"""Touches the skin before the first press (`tacdata.registration.evidence.prove_zero`)."""
JUDGED = 3
"""Presses after a start whose first contact is compared with depth zero at once; so is the first of each mounting."""
REPORT_RATE = 5.0
"""Status reports per second of a controller that states no rate [Hz]."""
FIRST_FRAME = 5.0
"""Time allowed for the streams to begin [s of real time]."""
FIRST_SEARCH = 20.0
"""Time for the tag detector to load [s of real time]; then the motion starts without."""


class Recorder:
    """One session of recording.

    Example:
        ``Recorder(rig, sensor, plan, Path("session")).run(confirm=lambda summary: True)``
    """

    def __init__(
        self,
        rig: Rig,
        sensor: Sensor,
        plan: Plan,
        folder: Path,
        resume: bool = False,
        devices: RigDevices | None = None,
        mount: Callable[[Press], None] | None = None,
        detect: Detect | None = None,
        progress: Callable[[int, int, float], None] | None = None,
        sync_tap: bool = False,
        say: Callable[[str], None] | None = None,
        watch: Watch | None = None,
        interruption: Interruption | None = None,
        ask: Ask = lambda question: False,
        confirmed: str = "",
        prove: Prove | None = None,
    ) -> None:
        """Prepare; nothing is opened, created or moved.

        Args:
            rig: The rig; its clock is the recording's.
            sensor: The skin that is pressed.
            plan: Presses. There is no motion without a plan.
            folder: Session folder to create, or to continue with ``resume``.
            resume: Continue with the next press that has no finished recording.
            devices: Drivers; by default those that the rig file names.
            mount: Called when another indenter, or another yaw of it, is needed; returns when it is mounted.
            detect: Searches an image for its cube (`detection_process`); if None, images are only stored.
            progress: Called with (presses done, presses wanted, real seconds left) after each press.
            sync_tap: Begin with touches that measure each stream's constant latency.
            say: Called with messages for a person.
            watch: Called with a sample of the data (`live_feed`); must return at once.
            ask: Puts a question to a person that no --yes answers; by default nobody confirms.
            confirmed: Code of the question about a lost position that a person answered in advance with yes.
            prove: Touches the skin before the first press, unless the machine has just homed for a new session; raises
                where the skin begins elsewhere than the registration states.
            interruption: Holds Ctrl-C back while the guide moves; without it, Python raises it anywhere.
        """
        self.rig, self.sensor, self.plan, self.out, self.resume = rig, sensor, plan, Path(folder), resume
        self.devices = devices or RigDevices.of(rig)
        self._mount, self._detect, self._progress = mount, detect, progress
        self._mounted: tuple[str, float, float, float] | None = None
        self._bad_readings = False  # then no contact is judged: the plan takes such readings
        self._height = safe_height(plan, rig)
        self._interruption = interruption or Interruption()
        self._state = MachineState(rig, self.devices.cnc)
        self._guard = PositionGuard(self._state, self.devices.cnc, ask, confirmed)
        self._motion = GuardedMotion(self.devices.cnc, rig.clock, self._interruption, self._state)
        self._tap = tap_motion.touch(plan, sensor) if sync_tap else None
        self._say, self._watch, self._ask = say or (lambda words: None), watch, ask
        self._prove = prove
        self._latencies: dict[str, StreamLatency] = {}

    def run(self, confirm: Callable[[Preflight], bool]) -> Session:
        """Check, ask for confirmation, then record every remaining press.

        Args:
            confirm: Called with the preflight summary before the first move; False ends the session.

        Returns:
            The session as stored on disk.

        Raises:
            UsageError: If the folder exists (or, resuming, does not), the summary was refused, or the board sends
                another number of channels than the sensor has taxels.
            FormatError: If a press would leave the envelope or the skin.
            DeviceError: On a fault. The motion is stopped and the recording closed; --resume continues.
            KeyboardInterrupt: On Ctrl-C, after the same.
        """
        require_channels(self.devices.board, self.sensor)  # before the plan: its sites are off another skin too
        self.plan.check_against(self.sensor)
        session = self._existing_session()
        self._latencies = {} if session is None else latencies(session)
        numbers = tuple(press.index for press in self.plan.presses) if session is None else session.remaining
        if session is not None and not numbers:
            return session
        try:
            return self._open_and_record(session, numbers, confirm)
        except BaseException as error:
            if isinstance(error, BadReadings) and self._paused(error):
                # A person has just agreed to go on; the summary needs no second yes.
                return self.run(lambda summary: True)
            self._interruption.last_words()
            error.add_note(self._ending(self._guard.loss(), error))
            raise

    def _paused(self, error: BadReadings) -> bool:
        """After bad readings: whether a person has put them right and lets the session go on, as the plan allows."""
        if self.plan.on_bad_readings != "pause" or not self._motion.lifted or self.devices.cnc.position_lost:
            return False
        self._say(f"PAUSED: {error.given}; the tip is lifted")
        question = f"Put the board right: {error.remedy.split(', then')[0]}. Go on with this press? [y/N] "
        if not self._ask(question):
            return False
        self.resume = True
        self._motion = GuardedMotion(self.devices.cnc, self.rig.clock, self._interruption, self._state)
        return True

    def _say_bad(self, words: str) -> None:
        self._bad_readings = True
        self._say(f"WARNING: {words}; it goes on, as the plan says")

    def _open_and_record(
        self, session: Session | None, numbers: tuple[int, ...], confirm: Callable[[Preflight], bool]
    ) -> Session:
        # Before the ports are opened, as opening may home: with a tip in the skin, that moves sideways.
        self._guard.before_homing(session is not None)
        with self._guard.opened(self.devices) as devices:
            cnc = devices.cnc
            limits = AxisLimits(np.asarray(cnc.acceleration, float), np.asarray(cnc.max_rate, float))
            rate = cnc.describe().get("status_rate", {}).get("nominal", REPORT_RATE)
            self.plan = replace(self.plan, motion=with_safe_travel(self.plan.motion, limits, rate))
            bounds = cnc.travel, cnc.cautions
            summary = preflight(self.plan, self.sensor, self.rig, limits, numbers, *bounds, self._tap)
            if not confirm(summary):
                raise UsageError("the summary was not confirmed", "yes", "nothing was moved; start again when ready")
            self._guard.require_known(self._height, session is not None)
            if session is None:  # one without recordings counts as empty
                session = create_session(self.out, self.plan, self.sensor, self.rig.document)
            with RigStreams(
                devices,
                self.rig.cameras,
                self._motion.stop,
                self._detect,
                self._watch,
                self.rig.fingers,
                self._motion.off_path,
                self._say_bad if self.plan.on_bad_readings == "go on" else None,
            ) as streams:
                try:
                    with self._interruption.kept():
                        self._record_all(session, streams, limits, summary, numbers)
                except BaseException:
                    with suppress(TacdataError):  # the fault itself must be reported first
                        refresh(session)
                    raise
            session = refresh(session)
        return session

    def _ending(self, lost: str, error: BaseException) -> str:
        again = "the same command" + (" with --resume" if self.out.exists() else "")
        return ending(self._motion, lost, on_disk(self.out, len(self.plan.presses)), again, error)

    def _existing_session(self) -> Session | None:
        if self.resume:
            return resume_session(self.out, self.plan, self.sensor, self.rig.document)
        if self.out.exists():
            raise UsageError(
                f"{self.out} exists", "a new session folder", "choose another --out, or continue it with --resume"
            )
        return None

    def _record_all(
        self, session: Session, streams: RigStreams, limits: AxisLimits, summary: Preflight, numbers: tuple[int, ...]
    ) -> None:
        self._wait_for_streams(streams)
        streams.set_latencies(self._latencies)
        # First of all straight up: nobody knows how the tip was left.
        position = self._rise(streams)
        homed = self.devices.cnc.settings().get("homed_at_opening") == "yes"
        # A homed machine has just found its zero; others prove it by a slow touch before anything goes deep.
        if self._prove and (self.resume or not homed):
            position = self._touch_first(self._prove, self._tap or self.plan.presses[numbers[0]], position, streams)
        if self._tap is not None:
            session, position = self._touch(session, self._tap, position, streams, limits)
        durations = summary.seconds[-len(numbers) :]  # everything before this belongs to the sync tap
        judged = None
        for done, number in enumerate(numbers, start=1):
            press = self.plan.presses[number]
            position = self._change_indenter(press, position, streams)
            changed = press.mounting != judged
            position = self._record(press, position, streams, limits)
            session = refresh(session)
            # At first and after each change of the tool: a wrong height shows in the first press, before the plan's
            # deepest one.
            if (changed or done <= JUDGED) and not self._bad_readings:
                require_contact(file_names.finished(self.out)[press.index])
            judged = press.mounting
            if self._progress:
                self._progress(done, len(numbers), sum(durations[done:]) / self.rig.clock.rate)

    def _wait_for_streams(self, streams: RigStreams) -> None:
        host = self.rig.clock.host
        patience = Patience(FIRST_FRAME, host=host)
        while streams.frames < 2 or streams.position is None:
            if streams.fault:
                raise streams.fault
            self._interruption.check()
            if patience.over():
                raise streams.nothing_yet(FIRST_FRAME)
            host.sleep(WATCH)
        end = host.monotonic() + FIRST_SEARCH
        while not streams.searching and not streams.fault and host.monotonic() < end:
            self._interruption.check()
            host.sleep(WATCH)

    def _rise(self, streams: RigStreams) -> Position:
        """Go straight up to the clearance height; return the position there [mm]."""
        position = streams.position or (np.nan, np.nan, np.nan)
        above = self.rig.envelope.top_of_rise(position, self._height)
        if position[2] < self._height:
            speed = self.plan.motion.approach_speed
            try:
                position = self._motion.drive((Step("", above, speed),), position, streams, None)
            except BaseException:
                self._motion.lift(self._height, speed)
                raise
            self._motion.settle()
        return position

    def _change_indenter(self, press: Press, position: Position, streams: RigStreams) -> Position:
        """Have the press's indenter mounted, at a height that clears the longest; return the position [mm]."""
        mounting = press.mounting
        if mounting != self._mounted and self._mount:
            if position[2] < self._height:
                up = Step("", (*position[:2], self._height), self.plan.motion.approach_speed)
                position = self._motion.drive((up,), position, streams, None)
                self._motion.settle()
            with self._interruption.at_once():
                self._mount(press)
        self._mounted = mounting
        return position

    def _touch_first(self, prove: Prove, press: Press, position: Position, streams: RigStreams) -> Position:
        """Prove the height by a touch with a press's indenter; return the position afterwards [mm]."""
        position = self._change_indenter(press, position, streams)
        return prove(
            self.rig,
            self.sensor,
            press,
            self.devices,
            streams,
            self._motion,
            self._interruption,
            self._height,
            self._say,
            position,
        )

    def _touch(
        self, session: Session, tap: Press, position: Position, streams: RigStreams, limits: AxisLimits
    ) -> tuple[Session, Position]:
        """Carry out the sync tap and use the latencies that it measures; return the session and the position [mm]."""
        position = self._change_indenter(tap, position, streams)
        # The tap has to show the whole delay, so nothing is subtracted in its own recording.
        previous, self._latencies = self._latencies, {}
        streams.set_latencies({})
        course = tap_motion.steps(tap, self.plan, self.rig.registration_for(tap.indenter_name))
        path = file_names.next_sync_tap(self.out)
        try:
            position = self._record(tap, position, streams, limits, path, course)
        except OwesAnswer as error:
            if streams.fault or not self._motion.lifted or self.devices.cnc.position_lost:
                raise
            self._say(f"{error.given}; the indenter was lifted, and the sync tap is tried once more")
            position, path = self._motion.go_on(), file_names.next_sync_tap(self.out)
            position = self._record(tap, position, streams, limits, path, course)
        measurement = delays.measure(read_recording(path))
        for words in (*measurement.words, *changes(session, measurement.latencies)):
            self._say(words)
        session = add_sync(session, path, measurement)
        self._latencies = {**previous, **measurement.latencies}
        streams.set_latencies(self._latencies)
        return session, position

    def _record(
        self,
        press: Press,
        position: Position,
        streams: RigStreams,
        limits: AxisLimits,
        path: Path | None = None,
        course: tuple[Step, ...] = (),
    ) -> Position:
        """Record one press from ``position`` [mm], or another course of steps; return the position at its end."""
        path = path or file_names.episode(self.out, press.index)
        course = course or steps(press, self.plan.motion, self.rig.registration_for(press.indenter_name))
        cameras, fingers = tuple(self.devices.cameras), tuple((self.rig.fingers or {}).get("fingers", ()))
        writer = EpisodeWriter(path, self._header(press, limits), self.rig.clock, cameras, fingers)
        # Before the first move, so that the rest without contact is in the file.
        streams.record_into(writer)
        try:
            position = self._motion.drive(course, position, streams, writer)
        except BaseException as error:
            reason = error.given if isinstance(error, TacdataError) else "stopped by Ctrl-C"
            try:
                # The tip first, the file afterwards: writing can wait, skin relaxes and tears.
                lifted = self._motion.lift(self._height, self.plan.motion.approach_speed)
                if not self._motion.lifted:  # a person must free it, and a slow disk may delay the last lines
                    self._say(f"WARNING: {reason}; {lifted}")
                writer.note(f"broken off: {reason}; {lifted}", "error")
            finally:
                with suppress(DeviceError):  # the fault itself must be reported first
                    self._close(writer, streams, reason)
            raise
        self._motion.settle()
        self._close(writer, streams)
        return position

    def _close(self, writer: EpisodeWriter, streams: RigStreams, broken_off: str = "") -> None:
        streams.catch_up()
        # Before `record_into`, which resets the counts.
        counts = streams.counts
        streams.record_into(None)
        reason = f"broken off: {broken_off}" if broken_off else ""
        writer.close(not broken_off, reason, streams.clock_models, counts)

    def _header(self, press: Press, limits: AxisLimits) -> Header:
        controller = {
            "settings": self.devices.cnc.settings(),
            "acceleration": limits.acceleration.tolist(),
            "max_rate": limits.max_rate.tolist(),
        }
        board = self.devices.board.describe()
        documents = self.rig.document, self.plan.document or {}
        return Header(press, self.sensor, *documents, board, controller, self._latencies)
