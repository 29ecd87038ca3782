"""Where a machine was left is known to every session: after a loss, a kill or a move by hand nothing moves unasked."""

import json
import re

import numpy as np
import pytest
from simulated_rig import ORIGIN, World

from tacdata.errors import DeviceError, FormatError
from tacdata.recording.live import machine_state

PRESSING = 7_000_000_000
"""Time at which the tip is in the skin [ns]."""
BANNER = 288_000_000
"""Time at which a controller was reset and has not stated yet who it is [ns]."""
NO_HOMING = {"$20": "0", "$22": "0"}


@pytest.fixture
def world(tmp_path):
    """A machine without homing."""
    made = World(1, tmp_path / "session", settings=NO_HOMING)
    yield made
    made.end()


def broken_in_mid_press(world, act):
    """Record until something happens in mid-press; return what was raised."""
    world.schedule.at(PRESSING, act)
    try:
        world.record()
    except DeviceError as error:
        return error
    finally:
        assert world.position()[2] < ORIGIN[2], "the tip is in the skin"
        world.reboot()


def refused(world, **options):
    """Try to record; the machine must not move. Return the refusal."""
    world.schedule.run_for(5.0, world.bench)
    before, begun = world.position(), len(world.path)
    with pytest.raises(DeviceError) as raised:
        world.record(**options)
    places = np.array([row[1:4] for row in world.path[begun:]])
    assert np.abs(places - before).max() < 1e-6, "it moved"
    world.reboot()
    return raised.value


def jog(world, up):
    """Jog straight up by hand [mm], as a pendant does."""
    world.schedule.run_for(1.0, world.bench)
    machine, now = world.controller.machine, world.clock.now_ns()
    machine.reset(now)  # a hold may stand
    machine._move(machine.planner.target - machine.error + [0.0, 0.0, up], 5.0, now, "Jog")
    world.schedule.run_for(3.0, world.bench)


def state_of(world):
    return json.loads(next((world.folder.parent / "machines").glob("*.json")).read_text())


def test_a_new_session_asks_after_a_power_cycle_in_mid_press(world):
    broken_in_mid_press(world, world.controller.inject_brown_out)
    world.folder = world.folder.with_name("session2")
    error = refused(world)
    assert "the position is not known: the controller was reset in mid-stream" in error.given
    assert "--yes does not" in error.remedy
    assert not world.folder.exists()
    assert len(world.asked) == 1
    refused(world)
    assert len(world.asked) == 2, "asking does not clear it"


def test_a_line_that_breaks_while_it_is_opened_leaves_its_loss_beside_the_rig(tmp_path):
    world = World(1, tmp_path / "session", firmware="grblHAL")
    try:
        world.schedule.at(BANNER, world.cnc_line.close)
        with pytest.raises(DeviceError, match="broke"):
            world.record()
        world.cnc_line.plug_in()
        world.reboot()
        error = refused(world)
        assert "the position is not known: the line to the controller" in error.given
        world.answer = lambda question: True
        world.record()
        world.folder, count = world.folder.with_name("session2"), len(world.asked)
        world.record()
        assert len(world.asked) == count, "a yes clears it"
    finally:
        world.end()


def test_a_yes_clears_it_for_every_session(world):
    broken_in_mid_press(world, world.controller.inject_brown_out)
    world.home()
    world.answer = lambda question: True
    assert world.record(resume=True).remaining == ()
    assert "lost" not in state_of(world)
    assert not state_of(world)["moving"]
    world.reboot()
    world.folder, world.answer = world.folder.with_name("session2"), lambda question: False
    assert world.record().remaining == ()
    assert len(world.asked) == 1


def test_homing_clears_it(tmp_path):
    world = World(1, tmp_path / "session")
    broken_in_mid_press(world, world.controller.inject_brown_out)
    world.answer = lambda question: "about to home" in question
    with pytest.raises(DeviceError, match="outside the envelope"):  # its switches are far from the skin
        world.record(resume=True, home=True)
    world.end()
    assert len(world.asked) == 1
    assert "lost" not in state_of(world)


@pytest.mark.parametrize("up", [0.0, 1.0])
def test_after_a_mains_outage_the_places_differ(world, up):
    """Computer and controller lose their power; then the tip is freed by hand, which counts from zero."""

    def outage():
        world.computer.kill()
        world.controller.inject_brown_out()

    broken_in_mid_press(world, outage)
    world.schedule.run_for(1.0, world.bench)
    jog(world, up)
    error = refused(world, resume=True)
    assert "a program ended while the machine moved" in error.given
    world.folder = world.folder.with_name("session2")
    refused(world)


def test_a_jog_between_two_sessions_is_asked_about(world):
    world.record()
    world.reboot()
    jog(world, 1.0)
    world.folder = world.folder.with_name("session2")
    error = refused(world)
    assert re.search(r"the controller reports \(.*\) mm, and the machine was left at \(.*\) mm", error.given)


def test_a_refused_summary_does_not_accept_the_place(world):
    world.record()
    world.reboot()
    jog(world, 1.0)
    world.folder = world.folder.with_name("session2")
    refused(world)
    assert "was left at" in refused(world).given, "the refusal before must not have taken the new place"


def test_a_killed_program_is_asked_about(world):
    broken_in_mid_press(world, world.computer.kill)
    assert state_of(world)["moving"]
    assert "a program ended while the machine moved" in refused(world, resume=True).given
    world.answer = lambda question: True
    assert world.record(resume=True).remaining == ()


def test_what_ended_well_is_not_asked_about(world):
    world.record()
    assert state_of(world)["position"] == pytest.approx(world.position(), abs=0.01)
    world.reboot()
    world.folder = world.folder.with_name("session2")
    assert world.record().remaining == ()
    assert world.asked == []


def test_a_tip_that_was_lifted_is_not_asked_about(world):
    broken = lambda: world.board_line.close()  # noqa: E731
    world.schedule.at(PRESSING, broken)
    with pytest.raises(DeviceError, match="taxel board"):
        world.record()
    world.reboot()
    world.board_line.plug_in()
    assert world.record(resume=True).remaining == ()
    assert world.asked == []


def test_another_computer_asks_before_it_continues_a_session(world):
    world.schedule.at(PRESSING, lambda: world.board_line.close())
    with pytest.raises(DeviceError):
        world.record()
    world.reboot()
    world.board_line.plug_in()
    for path in (world.folder.parent / "machines").glob("*.json"):
        path.unlink()
    assert "there is no record of where the machine was left" in refused(world, resume=True).given


def test_the_code_of_a_question_answers_it_and_no_later_one(world):
    broken_in_mid_press(world, world.controller.inject_brown_out)
    code = re.search(r"--confirm-position (\w+)", refused(world, resume=True).remedy)[1]
    world.home()
    assert world.record(resume=True, confirmed=code).remaining == ()
    world.reboot()
    jog(world, 1.0)
    world.folder = world.folder.with_name("session2")
    assert code not in refused(world, confirmed=code).remedy


FORGOTTEN = {
    "the record was deleted": None,
    "another controller": ("controller", {"driver": "grbl", "firmware": "another board", "usb": ""}),
    "another port, without a serial number": ("port", "/dev/ttyUSB7"),
}


@pytest.mark.parametrize("change", FORGOTTEN.values(), ids=FORGOTTEN)
def test_a_machine_without_homing_that_nobody_remembers_is_asked_about(world, change):
    """Freed by a jog, it does not report the zero of power-on."""
    broken_in_mid_press(world, world.controller.inject_brown_out)
    jog(world, 1.0)
    path = next((world.folder.parent / "machines").glob("*.json"))
    path.write_text(json.dumps(state_of(world) | {"name": "another"} | dict([change]))) if change else path.unlink()
    world.folder = world.folder.with_name("session2")
    assert "there is no record of where the machine was left" in refused(world).given


@pytest.mark.parametrize("up", [0.0, 1.0])
def test_a_grbl_with_homing_that_nobody_remembers_is_asked_about(tmp_path, up):
    """Unlocked by $X after a power cycle in mid-press, it looks like one that was homed."""
    world = World(1, tmp_path / "session", zero=True)
    broken_in_mid_press(world, world.controller.inject_brown_out)
    world.controller.machine.alarm = None
    jog(world, up)
    next((world.folder.parent / "machines").glob("*.json")).unlink()
    world.folder = world.folder.with_name("session2")
    assert "the position is not known" in refused(world).given
    world.home()
    world.answer = lambda question: True
    assert world.record().remaining == ()
    world.reboot()
    world.folder, world.answer = world.folder.with_name("session3"), lambda question: False
    world.asked.clear()
    assert world.record().remaining == ()
    assert world.asked == [], "one yes is enough"
    world.end()


def test_a_port_that_was_renamed_is_known_by_its_link(world):
    """A board without a serial number is on another port after a reboot; its link in /dev/serial/by-id is the same."""
    broken_in_mid_press(world, world.controller.inject_brown_out)
    path = next((world.folder.parent / "machines").glob("*.json"))
    path.write_text(json.dumps(state_of(world) | {"port": "/dev/ttyUSB7"}))
    world.folder = world.folder.with_name("session2")
    assert "the controller was reset in mid-stream" in refused(world).given


def test_two_boards_of_one_serial_number_have_a_record_each(world, monkeypatch):
    """Their maker gave all of them the same; while a port is there, its record is that of the board on it."""
    plugged = {world.cnc_line.path: "10c4:ea60 0001", "/dev/ttyUSB7": "10c4:ea60 0001"}
    monkeypatch.setattr(machine_state, "usb_identity", lambda port: plugged.get(port, ""))
    world.record()
    world.reboot()
    path = next((world.folder.parent / "machines").glob("*.json"))
    twin = {"port": "/dev/ttyUSB7", "name": "/dev/ttyUSB7", "position": [1.0, 2.0, 3.0], "number": 1000}
    twin = state_of(world) | twin
    path.with_name("twin.json").write_text(json.dumps(twin))
    world.folder = world.folder.with_name("session2")
    assert world.record().remaining == ()
    assert world.asked == []
    world.reboot()
    plugged["/dev/ttyUSB7"] = "2341:0043 7"  # another device: one board had both ports, and the later record counts
    world.folder = world.folder.with_name("session3")
    assert "the machine was left at (1.000, 2.000, 3.000) mm" in refused(world).given


def test_a_damaged_record_is_named_and_nothing_moves(world):
    world.record()
    world.reboot()
    path = next((world.folder.parent / "machines").glob("*.json"))
    path.write_text(path.read_text()[:40])
    world.folder = world.folder.with_name("session2")
    with pytest.raises(FormatError, match=r"cannot be read, so it is unknown where a machine was left"):
        world.record()


HAL_UNLOCKED = {"firmware": "grblHAL", "settings": {"$22": "1"}}


@pytest.mark.parametrize("setting", [{"settings": NO_HOMING}, HAL_UNLOCKED], ids=["no homing", "grblHAL"])
def test_a_zero_of_power_on_is_asked_about_though_it_was_left_there(tmp_path, setting):
    """Left at (0, 0, 0), switched off, moved by hand, switched on: the report is that of the record."""
    world = World(1, tmp_path / "session", zero=True, **setting)
    world.record()
    world.reboot()
    path = next((world.folder.parent / "machines").glob("*.json"))
    path.write_text(json.dumps({**json.loads(path.read_text()), "position": [0.0, 0.0, 0.0]}))
    world.controller.inject_brown_out()
    world.folder = world.folder.with_name("session2")
    assert "reports exactly (0, 0, 0), as when it is switched on" in refused(world).given
    world.end()


@pytest.mark.parametrize("up", [0.0, 3.0])
def test_another_computer_asks_a_grblhal_that_was_not_homed(tmp_path, up):
    world = World(1, tmp_path / "session", **HAL_UNLOCKED)
    world.is_new = False
    world.controller.inject_brown_out()
    jog(world, up)
    assert "the position is not known" in refused(world).given
    world.end()
