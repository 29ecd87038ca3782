"""The GRBL driver against the emulated firmware, through a real pseudo-terminal."""

import threading
import time

import numpy as np
import pytest

from tacdata.clock import Clock
from tacdata.devices.device import MotionController, create
from tacdata.devices.grbl import Grbl
from tacdata.errors import DeviceError, UsageError
from tacdata.virtual_rig.firmware.controller import Controller

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


def until(condition, seconds=20.0):
    """Wait until something is so, however busy the machine is."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)


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
    [{"settings": {"$10": "0"}, "offset": (-10.0, 5.0, 2.5)}, {"settings": {"$13": "1"}}, {"settings": {"$10": "3"}}],
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
    height = lambda: controller.position_at(clock.now_ns())[2]  # noqa: E731
    with driver:
        driver.move((-50.0, -50.0, -36.0), 1.0)  # seconds of real time, of which a busy machine may sleep through some
        until(lambda: height() < -20.5)
        driver.feed_hold()
        until(lambda: driver._opened().fresh_status(5.0).state == "Hold:0")
        held = controller.position_at(clock.now_ns())
        clock.sleep(2)
        assert driver._opened().fresh_status(5.0).state == "Hold:0"
        np.testing.assert_array_equal(controller.position_at(clock.now_ns()), held)
        assert -35.5 < held[2] < -20.5
        driver.resume()
        driver.wait_idle(20)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-50, -50, -36], atol=2e-3)


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
            driver.move((-50.0, -50.0, -35.0), 0.2)
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
            wait_for_fault(driver, 10.0)  # it may say nothing for 3 s


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
    until(lambda: controller.position_at(clock.now_ns())[2] < -20.2)
    driver.close()  # in motion: feed hold
    until(lambda: 0x21 in [byte for byte, _ in controller.heard])
    (heard_ns,) = (time_ns for byte, time_ns in controller.heard if byte == 0x21)
    clock.sleep(2)
    held = controller.position_at(clock.now_ns())
    went = controller.position_at(heard_ns) - held
    np.testing.assert_allclose(went[:2], 0, atol=0.001)
    assert 0.02 < went[2] < 0.03, "0.5 mm/s for the 45 ms that Grbl has cut into steps ahead, and the braking"
    assert held[2] > -30
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


HAL = {"firmware": "grblHAL"}
BOTH = pytest.mark.parametrize("rig", [{}, HAL], indirect=True, ids=["Grbl", "grblHAL"])


def start(**options):
    clock = Clock.start(RATE)
    controller = Controller(clock, seed=1, position=START, **options)
    return clock, controller, Grbl(clock, controller.port.path)


@pytest.mark.parametrize("rig", [HAL], indirect=True)
def test_grblhal_tells_what_it_is(rig):
    _, _, driver = rig
    with driver:
        said = driver.settings()
        driver.move((-50.0, -50.0, -21.0), 5.0)
        driver.wait_idle(10)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-50, -50, -21], atol=2e-3)
    assert (said["FIRMWARE"], said["NVS STORAGE"]) == ("grblHAL", "*EEPROM 2K")
    assert said["PLUGIN"] == "none v0.1; another v0.2"


@pytest.mark.parametrize("firmware", ["Grbl", "grblHAL"])
def test_a_board_with_an_empty_memory_that_starts_late(firmware):
    _, controller, driver = start(firmware=firmware, fresh=True, settings={"$22": "0", "$20": "0"})
    threading.Timer(0.5, controller.start).start()
    with driver:
        said = driver.settings()
        assert said["reset_at_opening"] == "yes"
        assert said["$110"] == "1800.000"
        assert "touch off before moving" in driver.cautions[0]
        driver.move((-50.0, -50.0, -21.0), 5.0)
        driver.wait_idle(10)
        driver.check()
    controller.stop()


def test_parameters_that_cannot_be_read_do_not_shift_the_answers(rig):
    _, controller, driver = rig
    controller.inject_unreadable_memory()
    with driver:
        assert "G54" not in driver.settings()
        assert driver.settings()["GC"].startswith("G0 G54")
        motion = driver.dwell(1.0)
    assert (motion.acknowledged_ns - motion.sent_ns) * 1e-9 >= 1.0


def test_a_line_longer_than_the_buffer_is_refused_before_it_is_sent(rig):
    _, controller, driver = rig
    with driver:
        before = len(controller.machine.planner.blocks)
        with pytest.raises(DeviceError, match=r"(?s)100 bytes.*at most 79"):
            driver._opened().command("G1X" + "0" * 97, 5.0)
        driver.check()
        assert len(controller.machine.planner.blocks) == before


def test_lines_of_many_threads_never_overrun_the_buffer(rig):
    _, _, driver = rig
    with driver:
        driver.dwell(0.5)
        done = []

        def send(k):
            for _ in range(6):
                driver.move((-50.0, -50.0, -20.0 - 0.1 * k), 10.0)
            done.append(k)

        threads = [threading.Thread(target=send, args=(k,)) for k in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        assert sorted(done) == list(range(8))
        driver.wait_idle(30)


@BOTH
def test_after_a_refused_line_the_retract_is_obeyed(rig):
    _, _, driver = rig
    with driver:
        with pytest.raises(DeviceError, match="error:20"):
            driver._opened().command("G77X1", 5.0)
        driver.feed_hold()
        x, y, z = driver.abandon()
        assert (x, y, z) == pytest.approx(START, abs=2e-3)
        driver.move((x, y, -15.0), 5.0)
        driver.wait_idle(10)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-50, -50, -15], atol=2e-3)


@BOTH
def test_a_hold_ends_the_wait_and_lets_no_line_out(rig):
    clock, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -45.0), 1.0)  # 3 s of real time
        threading.Timer(0.15, driver.feed_hold).start()
        with pytest.raises(DeviceError, match="stopped by a feed hold"):
            driver.dwell(0.01)
        with pytest.raises(DeviceError, match="stopped by a feed hold"):
            driver.move((-50.0, -50.0, -50.0), 2.0)
        rest = driver.abandon()
        clock.sleep(2)
        np.testing.assert_allclose(controller.position_at(clock.now_ns()), rest, atol=2e-3)
        assert -45 < rest[2] < -20
        assert [byte for byte, _ in controller.heard if byte in (0x18, 0x21)] == [0x21, 0x18]


@BOTH
def test_somebody_elses_hold_is_noticed(rig):
    clock, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -45.0), 1.0)
        clock.sleep(0.5)  # it is on its way
        controller.inject_byte(0x21)
        with pytest.raises(DeviceError, match="someone held"):
            driver.dwell(0.01)
        driver.feed_hold()
        assert driver.abandon()[2] < -20
        driver.check()


@BOTH
def test_an_open_door_stops_and_lets_nothing_move_until_it_is_closed(rig):
    clock, controller, driver = rig
    with driver:
        driver.move((-50.0, -50.0, -30.0), 1.0)
        controller.inject_door(True)
        with pytest.raises(DeviceError, match="safety door was opened"):
            driver.dwell(0.01)
        driver.feed_hold()
        with pytest.raises(DeviceError, match="door is open"):
            driver.abandon()
        controller.inject_door(False)
        clock.sleep(1)
        x, y, z = driver.abandon()
        driver.move((x, y, z + 2.0), 5.0)
        driver.wait_idle(10)
        np.testing.assert_allclose(driver.statuses()[-1].position, [-50, -50, z + 2], atol=2e-3)


def test_overrides_are_set_back_at_opening_and_minded_after(rig):
    _, controller, driver = rig
    controller.inject_byte(0x92)
    with driver:
        time.sleep(0.05)
        assert controller.machine.override == 100
        driver.move((-50.0, -50.0, -40.0), 2.0)
        controller.inject_byte(0x92)
        with pytest.raises(DeviceError, match="feed override stands at 90 %"):
            driver.dwell(0.01)
        driver.feed_hold()
        driver.abandon()
        driver.check()


@pytest.mark.parametrize(
    ("lines", "state", "remedy"),
    [(["$SLP"], "Sleep", "wake it"), (["$C"], "Check", "check mode"), (["$J=G91X-20F60"], "Jog", "let it finish")],
)
def test_states_that_only_a_person_should_end(rig, lines, state, remedy):
    clock, controller, driver = rig
    for line in lines:
        controller.machine.execute(line, clock.now_ns())
    with pytest.raises(DeviceError, match=rf"(?s)in state {state}.*{remedy}"):
        driver.open()


def test_a_startup_line_that_moves_is_refused(rig):
    _, controller, driver = rig
    controller.machine.startup[1] = "G0Z-1"
    with pytest.raises(DeviceError, match="at every reset"):
        driver.open()


@pytest.mark.parametrize("rig", [{"homed": False, "settings": {"$22": "0", "$20": "0"}}], indirect=True)
def test_a_locked_machine_without_homing_is_to_be_unlocked_by_hand(rig):
    _, _, driver = rig
    with pytest.raises(DeviceError, match=r"(?s)locked.*unlock it \(\$X\)"):
        driver.open()


@pytest.mark.parametrize("rig", [{"homed": False}], indirect=True)
def test_giving_homing_up_resets_as_it_heeds_nothing_else(rig):
    clock, controller, driver = rig
    controller.settings["$25"] = "60"  # a minute of travel
    driver.home_first = True
    closed = []

    def give_up():
        until(lambda: controller.machine.homing)
        clock.sleep(2)
        link = driver._link
        driver.close()
        closed.append(link)

    threading.Thread(target=give_up, daemon=True).start()
    with pytest.raises(DeviceError):
        driver.open()
    until(lambda: 0x18 in [byte for byte, _ in controller.heard])
    clock.sleep(2)
    at = controller.position_at(clock.now_ns())
    clock.sleep(2)
    np.testing.assert_array_equal(controller.position_at(clock.now_ns()), at)


def test_soft_limits_are_known(rig):
    _, _, driver = rig
    assert driver.travel is None, "nothing is known before opening"
    with driver:
        lower, upper = driver.travel
        np.testing.assert_array_equal(lower, [-200, -200, -60])
        np.testing.assert_array_equal(upper, 0)
        assert driver.cautions == ()


def test_an_alarm_whose_line_was_lost_is_seen_in_the_status(rig):
    _, controller, driver = rig
    with driver:
        controller.machine.alarm = 0
        with pytest.raises(DeviceError, match="locked"):
            wait_for_fault(driver)


def test_the_middle_of_a_move_is_reported_as_the_firmware_counts(rig):
    _, _, driver = rig
    with driver:
        assert driver._opened().at_rest or driver._opened().fresh_status(5.0).state == "Idle"
        driver.move((-50.0, -50.0, -30.0), 1.0)
        assert not driver._opened().at_rest


def test_a_grbl_too_old_is_refused(rig):
    clock, controller, _ = rig
    controller.inject_silence()
    driver = Grbl(clock, controller.port.path)
    old = threading.Timer(0.3, controller.inject_bytes, (b"\r\nGrbl 0.9j ['$' for help]\r\n",))
    old.start()
    with pytest.raises(DeviceError, match=r"(?s)0\.9j.*Grbl 1\.1 or grblHAL"):
        driver.open()


def test_opening_leaves_dtr_up_for_the_next_opening():
    import os
    import termios

    from tacdata.wire.serial_port import open_port

    outer, line = os.openpty()
    attributes = termios.tcgetattr(line)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(line, termios.TCSANOW, attributes)
    for dtr in (None, False, True):
        open_port(os.ttyname(line), 115200, "motion controller", 0.05, dtr).close()
        assert not termios.tcgetattr(line)[2] & termios.HUPCL
    os.close(line)
    os.close(outer)
