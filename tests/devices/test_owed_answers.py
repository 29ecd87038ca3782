"""Whatever the controller owes has a limit, a reason and an ending; what bends coordinates is ended first."""

import re
import threading
import time

import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.grbl import Grbl
from tacdata.errors import DeviceError
from tacdata.recording.live.guarded_motion import GuardedMotion
from tacdata.virtual_rig.firmware.controller import Controller

RATE = 8.0
START = (-50.0, -50.0, -20.0)
SOON = 4.0
"""An idle controller that owes an answer is given up within so long [s, real time]; without a limit it was never."""


@pytest.fixture
def rig(request):
    clock = Clock.start(RATE)
    controller = Controller(clock, seed=1, position=START, **getattr(request, "param", {}))
    controller.start()
    clock.sleep(0.4)  # its welcome is spoken to nobody
    yield clock, controller, Grbl(clock, controller.port.path)
    controller.stop()


def once(pattern, arrives):
    """What the wire does to the first line that matches: `arrives` instead of it, None for nothing."""
    left = [1]

    def wire(line):
        if re.search(pattern, line) and left:
            left.pop()
            return arrives
        return line

    return wire


HAL = {"firmware": "grblHAL"}
BOTH = pytest.mark.parametrize("rig", [{}, HAL], indirect=True, ids=["Grbl", "grblHAL"])
LOST = [
    (lambda: {"to_host": once("^ok$", None)}, "still owes an answer to 'G4P0.500'$"),
    (lambda: {"to_host": once("^ok$", "o")}, r"still owes an answer to 'G4P0.500' \(it said 'o' instead\)"),
    (lambda: {"to_controller": once("^G4", None)}, "still owes an answer"),
]


@BOTH
@pytest.mark.parametrize(("wire", "words"), LOST, ids=["lost", "damaged", "the line itself was lost or stalls"])
def test_an_idle_controller_that_owes_an_answer_is_a_fault_and_can_be_lifted(rig, wire, words):
    _, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -24.0), 4.0)
        driver.dwell(0.01)
        controller.inject_wire(**wire())
        begun = time.monotonic()
        with pytest.raises(DeviceError, match=re.compile(words, re.MULTILINE)) as raised:
            driver.dwell(0.5)
        assert time.monotonic() - begun < SOON
        assert "stands idle" in raised.value.given
        driver.feed_hold()
        x, y, z = driver.abandon()
        assert z == pytest.approx(-24.0, abs=2e-3)
        driver.move((x, y, -20.0), 5.0)
        driver.wait_idle(10)
        assert driver.statuses()[-1].position[2] == pytest.approx(-20.0, abs=2e-3)
        assert driver.position_lost == ""


def test_an_answer_is_waited_for_as_long_as_the_motion_takes(rig):
    _, _, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -45.0), 1.0)  # 25 s of the clock, 3 s of real time
        driver.dwell(4.0)
        assert driver._opened().last.position[2] == pytest.approx(-45.0, abs=2e-3)


def test_an_error_in_words_is_an_answer(rig):
    _, controller, driver = rig
    with driver:
        controller.inject_wire(to_host=once("^ok$", "error: Invalid gcode ID:24"))
        with pytest.raises(DeviceError, match=r"refused 'G4P1.000': error:24"):
            driver.dwell(1.0)


def test_a_line_damaged_on_its_way_is_no_fault_of_the_plan(rig):
    _, controller, driver = rig
    with driver:
        controller.inject_wire(to_controller=lambda line: line.replace("G90", "G9?"))
        with pytest.raises(DeviceError, match=r"(?s)refused.*lost or changed on their way, so check cable"):
            driver.move((-50.0, -50.0, -24.0), 4.0)


def test_homing_whose_answer_is_lost_ends(rig):
    _, controller, driver = rig
    controller.settings["$25"] = "6000"
    with driver:
        controller.inject_wire(to_host=once("^ok$", None))
        with pytest.raises(DeviceError, match="stands idle and still owes an answer to '\\$H'"):
            driver.home()


@BOTH
def test_a_pendant_that_takes_over_is_seen_at_once_and_not_reset(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -24.0), 4.0)
        driver.dwell(0.01)
        controller.inject_pendant()
        begun = time.monotonic()
        with pytest.raises(DeviceError, match=r"pendant has taken control"):
            driver.dwell(0.5)
        assert time.monotonic() - begun < 1.0
        driver.feed_hold()
        with pytest.raises(DeviceError, match="pendant has control"):
            driver.abandon()
        assert 0x18 not in [byte for byte, _ in controller.heard]


def test_reports_without_a_number_are_no_position(rig):
    _, controller, driver = rig
    with driver:
        driver.statuses()
        controller.inject_wire(to_host=lambda text: re.sub(r"MPos:[^|>]*", "MPos:nan,nan,nan", text))
        end = time.monotonic() + 8
        with pytest.raises(DeviceError, match=r"cannot be read: '<Idle\|MPos:nan"):
            while time.monotonic() < end:
                driver.check()
                time.sleep(0.01)
        assert all(np.isfinite(status.position).all() for status in driver.statuses())


def test_a_door_that_opens_and_closes_while_it_brakes_is_waited_for(rig):
    clock, controller, driver = rig
    controller.settings["$122"] = "1"  # it brakes for seconds
    with driver:
        driver.move((-50.0, -50.0, -40.0), 2.0)
        clock.sleep(4)
        controller.inject_byte(0x84)
        with pytest.raises(DeviceError, match="safety door was opened"):
            driver.dwell(0.01)
        assert driver._opened().fresh_status(5.0).state == "Door:2"
        driver.feed_hold()
        x, y, z = driver.abandon()
        driver.check()
        np.testing.assert_allclose(controller.position_at(clock.now_ns()), (x, y, z), atol=3e-3)
        assert controller.machine.alarm is None


@pytest.mark.parametrize("rig", [HAL], indirect=True)
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("G51X2Y2Z2", "G51 (scaling of the axes) was active and was ended (G50)"),
        ("G92X0Y0Z0", "G92 (offset of the axes) was active and was ended (G92.1)"),
        ("G43.1Z3", "G43.1 (tool length offset) was active and was ended (G49)"),
        ("G20", "G20 (inches) was active and was ended (G21)"),
    ],
)
def test_what_bends_coordinates_is_ended_before_the_first_move_and_said(rig, line, words):
    clock, controller, driver = rig
    controller.machine.execute(line, clock.now_ns())
    with driver:
        assert words in driver.cautions
        driver.move((-40.0, -50.0, -22.0), 10.0)
        driver.wait_idle(10)
        np.testing.assert_allclose(controller.position_at(clock.now_ns()), [-40, -50, -22], atol=3e-3)


@pytest.mark.parametrize("rig", [HAL], indirect=True)
def test_what_cannot_be_ended_is_refused(rig):
    clock, controller, driver = rig
    controller.machine.execute("G51X2", clock.now_ns())
    controller.inject_wire(to_controller=lambda line: "" if line == "G50" else line)
    with pytest.raises(DeviceError, match="does not leave a state that spoils every move: G51"):
        driver.open()


@pytest.mark.parametrize("rig", [{**HAL, "settings": {"$10": "0"}, "offset": (-10.0, 5.0, 2.5)}], indirect=True)
def test_work_positions_whose_offset_is_never_said(rig):
    _, controller, driver = rig
    controller.inject_wire(to_host=lambda text: re.sub(r"\|WCO:[^|>]*", "", text))
    with driver:
        driver.move((-60.0, -41.5, -25.0), 10.0)
        driver.wait_idle(10)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-60, -41.5, -25], atol=4e-3)


@pytest.mark.parametrize("byte", [b"\x18"])
def test_what_loses_the_position_is_remembered_also_after_closing(rig, byte):
    _, controller, driver = rig
    with driver:
        assert driver.position_lost == ""
        driver.move((-50.0, -50.0, -30.0), 1.0)
        controller.inject_alarm(1)
        with pytest.raises(DeviceError):
            driver.wait_idle(20)
    assert "hard limit" in driver.position_lost


@pytest.mark.parametrize("rig", [{"homed": False}], indirect=True)
def test_homing_that_was_broken_off_is_never_said_to_have_moved_nothing(rig):
    clock, controller, driver = rig
    controller.settings["$25"] = "60"
    driver.home_first = True
    motion = GuardedMotion(driver, clock)
    assert motion.ending == ("motion: nothing was moved",)

    def break_off():
        while not controller.machine.homing:
            time.sleep(0.002)
        driver.close()

    threading.Thread(target=break_off, daemon=True).start()
    with pytest.raises(DeviceError):
        driver.open()
    clock.sleep(1)
    assert motion.ending == ("motion: the machine moved while homing, and homing was broken off: its position is lost",)
