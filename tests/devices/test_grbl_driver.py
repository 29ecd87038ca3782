"""The GRBL driver against the emulated firmware, through a real pseudo-terminal."""

import threading
import time

import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.device import MotionController, create
from tacdata.devices.grbl import Grbl
from tacdata.errors import DeviceError, UsageError
from tacdata.virtual_rig.controller import Controller

RATE = 8.0
START = (-50.0, -50.0, -20.0)


@pytest.fixture
def rig(request):
    clock = Clock.start(RATE)
    controller = Controller(clock, seed=1, position=START, **getattr(request, "param", {}))
    controller.start()
    clock.sleep(0.4)  # its welcome is spoken to nobody
    yield clock, controller, Grbl(clock, controller.port.path)
    controller.stop()


def wait_for_fault(driver, seconds=3.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        driver.check()
        time.sleep(0.01)


def test_opening_reads_the_settings(rig):
    _, _, driver = rig
    with driver:
        said = driver.settings()
        np.testing.assert_allclose(driver.max_rate, [30, 30, 15])
        np.testing.assert_allclose(driver.acceleration, [200, 200, 150])
    assert said["$110"] == "1800.000"
    assert said["VER"].startswith("1.1h")
    assert said["OPT"] == "V,15,128"
    assert said["G54"] == "0.000,0.000,0.000"
    assert said["GC"].startswith("G0 G54")
    assert "1.1h" in said["banner"]
    assert said["reset_at_opening"] == "no"


def test_rig_file_entry_builds_it(rig):
    clock, controller, _ = rig
    driver = create({"driver": "grbl", "port": controller.port.path, "poll_rate": 5}, MotionController, clock)
    assert driver.describe()["status_rate"] == {"nominal": 5, "unit": "Hz"}


def test_move_ends_where_and_when_it_should(rig):
    _, controller, driver = rig
    with driver:
        motion = driver.move((-50.0, -50.0, -30.0), 5.0)
        driver.wait_idle(10)
        last = driver.statuses()[-1]
    assert motion.sent_ns < motion.acknowledged_ns
    assert last.state == "Idle"
    np.testing.assert_allclose(last.position, [-50, -50, -30], atol=2e-3)
    stretches = controller.planner._past
    took = (stretches[-1].start_ns - stretches[0].start_ns) * 1e-9 + stretches[-1].seconds
    assert took == pytest.approx(10 / 5 + 5 / 150, rel=1e-3)
    assert abs(stretches[0].start_ns - motion.sent_ns) < 0.5e9


def test_reports_follow_the_motion(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-40.0, -50.0, -20.0), 4.0)
        driver.wait_idle(10)
        moving = [s for s in driver.statuses() if s.state == "Run"]
    assert len(moving) >= 5
    for status in moving:
        between = [controller.position_at(t)[0] for t in (status.sent_ns, status.arrival_ns)]
        assert between[0] - 0.005 <= status.position[0] <= between[1] + 0.005
    assert max(s.feed for s in moving) == pytest.approx(240, abs=1)


def test_more_moves_than_the_planner_holds(rig):
    _, _, driver = rig
    with driver:
        for k in range(40):
            driver.move((-50.0 + 0.2 * (k % 2), -50.0, -20.0), 5.0)
        driver.wait_idle(20)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-49.8, -50, -20], atol=2e-3)


def test_dwell_lasts_its_time(rig):
    clock, _, driver = rig
    with driver:
        motion = driver.dwell(2.0)
    assert 2.0 <= (motion.acknowledged_ns - motion.sent_ns) * 1e-9 < 4.0
    assert clock.rate == RATE


@pytest.mark.parametrize(
    "rig",
    [
        {"settings": {"$10": "0"}, "offset": (-10.0, 5.0, 2.5)},
        {"settings": {"$13": "1"}},
        {"settings": {"$10": "3"}},
    ],
    indirect=True,
)
def test_machine_position_whatever_the_report_settings(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-60.0, -41.5, -25.0), 10.0)
        driver.wait_idle(10)
        last = driver.statuses()[-1]
    np.testing.assert_allclose(controller.position_at(last.arrival_ns), [-60, -41.5, -25], atol=2e-3)
    np.testing.assert_allclose(last.position, [-60, -41.5, -25], atol=4e-3)


def test_feed_hold_keeps_the_position_and_resume_arrives(rig):
    clock, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 2.0)
        clock.sleep(2)
        driver.feed_hold()
        clock.sleep(1)
        held = controller.position_at(clock.now_ns())
        clock.sleep(2)
        assert driver.statuses()[-1].state == "Hold:0"
        np.testing.assert_array_equal(controller.position_at(clock.now_ns()), held)
        assert -29.5 < held[2] < -20.5
        driver.resume()
        driver.wait_idle(10)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-50, -50, -30], atol=2e-3)


def test_abandon_empties_the_planner_keeps_the_position_and_takes_a_retract(rig):
    clock, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 2.0)
        driver.move((-50.0, -40.0, -30.0), 2.0)
        clock.sleep(2)
        driver.feed_hold()
        driver.abandon()
        held = controller.position_at(clock.now_ns())
        driver.move((float(held[0]), float(held[1]), -20.0), 5.0)
        driver.wait_idle(10)
        last = driver.statuses()[-1]
    np.testing.assert_allclose(last.position, [-50, -50, -20], atol=2e-3)
    np.testing.assert_allclose(controller.position_at(clock.now_ns()), [-50, -50, -20], atol=2e-3)


def test_interrupted_wait_does_not_mix_up_later_answers(rig):
    _, _, driver = rig
    with driver:
        with pytest.raises(DeviceError, match="waited"):
            driver.move((-50.0, -50.0, -35.0), 1.0)
            driver.wait_idle(0.5)
        driver.feed_hold()
        driver.abandon()
        motion = driver.dwell(1.0)
        assert (motion.acknowledged_ns - motion.sent_ns) * 1e-9 >= 1.0


def test_alarm_in_mid_press_is_said_in_words(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 1.0)
        threading.Timer(0.1, controller.inject_alarm, (1,)).start()
        with pytest.raises(DeviceError, match=r"ALARM:1 \(a hard limit switch closed"):
            driver.wait_idle(20)
        with pytest.raises(DeviceError, match="ALARM:1"):
            driver.move((-50.0, -50.0, -20.0), 1.0)
        assert driver.statuses(), "what came before the fault is still handed out"


def test_beyond_the_soft_limits(rig):
    _, _, driver = rig
    with driver, pytest.raises(DeviceError, match=r"ALARM:2 .*soft limits"):
        driver.move((-50.0, -50.0, 5.0), 5.0)


def test_brown_out_in_mid_stream_means_position_lost(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 1.0)
        controller.inject_brown_out()
        with pytest.raises(DeviceError, match="position is lost"):
            driver.wait_idle(20)


def test_pulled_cable(rig):
    _, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 1.0)
        controller.unplug()
        with pytest.raises(DeviceError, match="broke"):
            driver.wait_idle(20)
        driver.feed_hold()  # a signal handler may call it whatever happened


def test_silent_controller(rig):
    _, controller, driver = rig
    with driver:
        controller.inject_silence()
        with pytest.raises(DeviceError, match="silent"):
            wait_for_fault(driver)


def test_garbage_on_the_line_is_survived(rig):
    _, controller, driver = rig
    with driver:
        controller.inject_bytes(b"\xff\x00<Idle|MPos:1,2\r\nnonsense\r\n<Id\xe9le|MPos:0,0,0|FS:0,0>\r\n")
        driver.move((-50.0, -50.0, -21.0), 5.0)
        driver.wait_idle(10)
        positions = np.array([s.position for s in driver.statuses()])
    assert positions[:, 2].max() < -19.9


@pytest.mark.parametrize("rig", [{"homed": False}], indirect=True)
def test_locked_machine_is_refused_and_homed_on_wish(rig):
    clock, controller, driver = rig
    with pytest.raises(DeviceError, match="locked"):
        driver.open()
    with Grbl(clock, controller.port.path, home=True) as willing:
        assert willing.settings()["state_at_opening"] == "Alarm"
        willing.wait_idle(10)
        np.testing.assert_allclose(willing.statuses()[-1].position, [-1, -1, -1], atol=2e-3)


def test_moving_machine_is_left_alone_and_a_held_one_cleared(rig):
    clock, controller, driver = rig
    driver.open()
    driver.move((-50.0, -50.0, -30.0), 0.5)
    clock.sleep(1)
    controller_before = controller.position_at(clock.now_ns())
    driver.close()  # in motion: feed hold
    clock.sleep(2)
    held = controller.position_at(clock.now_ns())
    assert abs(held[2] - controller_before[2]) < 2.0
    with Grbl(clock, controller.port.path) as again:
        assert again.settings()["state_at_opening"] == "Hold:0"
        again.wait_idle(5)
        np.testing.assert_allclose(again.statuses()[-1].position, held, atol=2e-3)


def test_missing_port_lists_the_others():
    with pytest.raises(DeviceError, match=r"no port /dev/ttyNOPE(.|\n)*a port that exists"):
        Grbl(Clock.start(), "/dev/ttyNOPE").open()


def test_busy_port(rig):
    clock, controller, driver = rig
    with driver, pytest.raises(DeviceError, match="in use"):
        Grbl(clock, controller.port.path).open()


def test_wrong_baud_shows_the_bytes(rig):
    clock, controller, _ = rig
    with pytest.raises(DeviceError, match=r"at 9600 baud speaks GRBL: it sent"):
        controller.inject_bytes(b"x" * 40)
        driver = Grbl(clock, controller.port.path, baud=9600)
        threading.Timer(0.3, controller.inject_bytes, (b"Grbl 1.1h ['$' for help]\r\n",)).start()
        driver.open()


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_impossible_speed(rig, speed):
    _, _, driver = rig
    with driver, pytest.raises(UsageError, match="speed above 0"):
        driver.move(START, speed)


def test_refused_line_says_why(rig):
    _, _, driver = rig
    with driver, pytest.raises(DeviceError, match=r"error:20 \(an unsupported"):
        driver._opened().command("G2X1Y1", 5.0)
