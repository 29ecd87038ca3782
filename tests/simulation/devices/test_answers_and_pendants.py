"""A lost answer and a pendant that takes over, at every stage: opening, travel, press, hold, lift, register."""

import re

import numpy as np
import pytest
from schedule import SECOND
from simulated_rig import CLEARANCE, ORIGIN, SENSOR, World
from simulated_run import Run, longest_rest

from tacdata.devices.device import OwesAnswer
from tacdata.errors import DeviceError
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.recording.live.interruption import Interruption
from tacdata.recording.live.rig_devices import RigDevices
from tacdata.registration import RegistrationSettings
from tacdata.registration.guarded_probe import guarded_probe
from tacdata.registration.procedure import register

PATIENCE = 10.0
"""Longest time from a lost answer to the end of the run [s], with a stop, a lift and the closing of the file."""
CLEAR = ORIGIN[2] + CLEARANCE - 0.02
"""Machine height from which the tip is clear of the skin [mm]."""
LINES = {
    "$I": r"\$I",
    "$$": r"\$\$",
    "$#": r"\$#",
    "$G": r"\$G",
    "$N": r"\$N",
    "the end of the first rise": r"G4P0\.01",
    "the first travel": r"G1X-95.*Z-35",
    "the press": r"G1X-9.*Z-38\.8.*F30",
    "the hold": r"G4P2",
    "the release": r"G1X-9.*Z-37\.7.*F30\.",
}
"""Lines of a recording, by the pattern of the first whose answer is lost."""
OPENING = {"$I", "$$", "$#", "$G", "$N"}


def losing(world, pattern, times=1):
    """Lose the answer of the first lines that match; return the times at which that happened [s]."""
    lost, owed = [], []

    def to_controller(line):
        owed.append(bool(re.search(pattern, line)) and len(lost) < times)
        return line

    def to_host(text):
        if text != "ok" and not text.startswith("error"):
            return text
        if owed and owed.pop(0) and len(lost) < times:
            lost.append(world.schedule.now)
            return None
        return text

    world.controller.inject_wire(to_controller, to_host)
    return lost


@pytest.fixture
def world(tmp_path):
    made = World(5, tmp_path / "session", presses=1)
    yield made
    made.end()


@pytest.mark.parametrize("stage", LINES)
def test_a_lost_answer_ends_within_seconds_with_the_line_named_and_the_tip_clear(world, stage):
    lost = losing(world, LINES[stage])
    world.schedule.run_for(0.05, world.bench)
    run = Run(world)
    assert len(lost) == 1
    if stage == "$I":  # asked again until question and answer belong together
        assert run.error is None, run.words
        return
    assert run.end - lost[0] < PATIENCE
    assert re.search(rf"stands idle and still owes an answer to '.*{LINES[stage]}", run.words), run.words
    if stage in OPENING:
        assert "motion: nothing was moved" in run.words
    else:
        assert run.here[2] > CLEAR
        assert "lifted off the skin" in run.words or "stands clear of the skin" in run.words


@pytest.mark.parametrize("line", ["G1Z", r"G4P0\.01"])
def test_a_lift_whose_answer_is_lost_ends_at_the_top_all_the_same(world, line):
    lost = []
    world.when_down_at(ORIGIN[2] - 0.7, lambda: lost.append(losing(world, line)))
    world.when_down_at(ORIGIN[2] - 0.7, lambda: world.board_line.close(), 0.05)
    run = Run(world)
    assert "the taxel board" in str(run.error)
    assert len(lost[0]) == 1
    assert run.here[2] > CLEAR, run.words
    assert "lifted off the skin" in run.words, run.words


def pendant_at(world, stage):
    """Let a pendant take control at a stage of the recording."""
    take = world.controller.inject_pendant
    if stage == "first report":
        take()
        world.schedule.run_for(0.05, world.bench)
    elif stage == "between the questions":
        world.controller.inject_wire(lambda line: (take(), line)[1] if line == "$#" else line)
    elif stage == "travel":
        world.schedule.at(round(2.0e9), take)
    elif stage == "press":
        world.when_down_at(ORIGIN[2] - 0.4, take)
    elif stage == "hold":
        world.when_down_at(ORIGIN[2] - 0.7999, take, 0.5)
    elif stage == "lift":
        world.when_down_at(ORIGIN[2] - 0.7999, lambda: world.board_line.close(), 0.5)
        world.controller.inject_wire(lambda line: (take(), line)[1] if "G1Z" in line else line)


@pytest.mark.parametrize("stage", ["first report", "between the questions", "travel", "press", "hold", "lift"])
@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
def test_a_pendant_is_seen_at_once_and_the_words_state_where_the_tip_is(tmp_path, stage, firmware):
    world = World(5, tmp_path / "session", presses=1, firmware=firmware)
    try:
        pendant_at(world, stage)
        run = Run(world)
    finally:
        world.end()
    assert "pendant" in run.words, run.words
    assert run.end < 25.0
    if stage in ("first report", "between the questions"):
        assert "motion: nothing was moved" in run.words
        return
    stands = re.search(r"stands at \((\S+), (\S+), (\S+)\) mm", run.words)
    assert stands, run.words
    assert [float(value) for value in stands.groups()] == pytest.approx(run.here.tolist(), abs=0.02)
    assert ("not lifted" in run.words) == (run.here[2] < CLEAR), run.words
    assert not run.moves_at_the_end


def test_a_person_reads_that_the_tip_stays_in_the_skin_before_a_slow_disk_has_the_file(world):
    taken = []

    def take():
        now = world.schedule.now_ns
        taken.append(world.schedule.now)
        world.computer.disk.slow.append((now, now + 9 * SECOND))
        world.controller.inject_pendant()

    world.when_down_at(ORIGIN[2] - 0.7999, take, 0.5)
    run = Run(world)
    assert "not lifted" in run.words
    assert run.end - taken[0] > 8.0, "the file waits for the disk"
    assert 0.0 < world.warned[0] - taken[0] < 0.5
    assert "a pendant has taken control" in world.said[-1]


def test_a_line_of_motion_that_never_arrived_is_missed_at_once(world):
    """The release is lost: the tip does not wait for the end of a motion that never began."""
    lost = []

    def to_controller(line):
        if lost or not re.search(LINES["the release"], line):
            return line
        lost.append(line)
        return None

    world.controller.inject_wire(to_controller)
    run = Run(world)
    assert lost
    assert isinstance(run.error, OwesAnswer)
    assert run.here[2] > CLEAR
    assert 1.0 < longest_rest(run) < 3.0


@pytest.mark.parametrize("moment", [0.25, 0.35])
@pytest.mark.parametrize(("alarm", "is_lost"), [(1, True), (2, False)])
def test_an_alarm_in_the_middle_of_the_opening_is_named_at_once(world, alarm, is_lost, moment):
    """Grbl answers nothing after it, whether it has reported once or not."""
    world.schedule.at(round(moment * SECOND), lambda: world.controller.inject_alarm(alarm))
    run = Run(world)
    assert f"stopped with ALARM:{alarm}" in str(run.error), run.words
    assert run.end < 1.0
    assert "nothing was moved" in run.words
    assert ("LOST" in run.words) == is_lost, run.words


def registering(world, act):
    """Register in the simulated world while something happens; return the error, and the motion's last lines."""
    world.schedule.extend(900.0)
    rig = world.rig()
    devices = RigDevices.of(rig)
    motion, said = None, []

    def work():
        nonlocal motion
        with Interruption(world.computer) as interruption:
            motion = GuardedMotion(devices.cnc, rig.clock, interruption)
            with devices.opened(), guarded_probe(rig, devices, ORIGIN[2] + 3.0, 5.0, interruption, motion) as probe:
                act()
                register(probe, SENSOR, rig.registration, RegistrationSettings(), said.append)

    with pytest.raises(DeviceError) as raised:
        world.computer.run(work)
    return raised.value, "\n".join(motion.ending)


def test_a_pendant_in_the_middle_of_a_registration_leaves_the_tip_and_states_its_place(world):
    act = lambda: world.when_down_at(ORIGIN[2] - 0.05, world.controller.inject_pendant)  # noqa: E731
    error, words = registering(world, act)
    assert "a pendant has taken control" in error.given
    stands = re.search(r"stands at \((\S+), (\S+), (\S+)\) mm", words)
    assert [float(value) for value in stands.groups()] == pytest.approx(world.position().tolist(), abs=0.02)
    assert "not lifted" in words


def test_two_lost_answers_in_a_registration_end_it_with_the_tip_clear(world):
    lost = []
    act = lambda: world.when_down_at(ORIGIN[2] - 0.05, lambda: lost.append(losing(world, r"F60\.", 2)))  # noqa: E731
    error, words = registering(world, act)
    assert isinstance(error, OwesAnswer)
    assert len(lost[0]) == 2
    assert world.position()[2] > CLEAR
    assert "stands clear of the skin" in words or "lifted off the skin" in words
    assert np.isfinite(world.position()).all()
