from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from recording_examples import plan

from tacdata.recording.episode import CncStream
from tacdata.recording.motion.move_times import Command, StatusTimes, anchor, machine_path, phases, report_resolution
from tacdata.recording.motion.press_steps import with_safe_travel
from tacdata.recording.motion.trapezoid import AxisLimits

LIMITS = AxisLimits(np.array([200.0, 200.0, 100.0]), np.array([50.0, 50.0, 10.0]))
T0 = 1_760_000_000_000_000_000


def test_trapezoid_closed_form():
    move = LIMITS.straight_move([0, 0, 5], [0, 0, 0], 2.0)
    assert move.duration == pytest.approx(5 / 2 + 2 / 100, abs=1e-12)
    # after the ramp (0.02 s, 0.02 mm) the move cruises at 2 mm/s
    assert move.distance(np.array([0.02]))[0] == pytest.approx(0.02, abs=1e-12)
    assert move.distance(np.array([1.02]))[0] == pytest.approx(2.02, abs=1e-12)
    assert move.distance(np.array([0.01]))[0] == pytest.approx(0.005, abs=1e-12)
    assert move.distance(np.array([move.duration]))[0] == pytest.approx(5.0, abs=1e-12)


def test_short_move_is_a_triangle():
    move = LIMITS.straight_move([0, 0, 0], [0, 0, -0.01], 5.0)
    assert move.peak == pytest.approx(np.sqrt(100 * 0.01))
    assert move.duration == pytest.approx(2 * np.sqrt(0.01 / 100), rel=1e-12)
    assert move.distance(np.array([move.duration / 2]))[0] == pytest.approx(0.005, rel=1e-12)


def test_axis_that_reaches_its_limit_first_decides():
    move = LIMITS.straight_move([0, 0, 0], [3, 0, 4], 100.0)
    assert move.speed == pytest.approx(10.0 / 0.8)
    assert move.acceleration == pytest.approx(100.0 / 0.8)
    assert LIMITS.straight_move([0, 0, 0], [1, 0, 0], 100.0).acceleration == pytest.approx(200.0)


@pytest.mark.parametrize("length", [0.004, 0.3, 40.0])
def test_time_inverts_distance_and_knots_follow_the_profile(length):
    move = LIMITS.straight_move([0, 0, 0], [0, length, 0], 7.0)
    t = np.linspace(0, move.duration, 501)
    np.testing.assert_allclose(move.time(move.distance(t)), t, atol=1e-9)
    time, position = move.knots()
    assert (np.diff(time) > 0).all()
    np.testing.assert_allclose(np.interp(t, time, position[:, 1]), move.distance(t), atol=2e-4)


def test_zero_length_move_takes_no_time():
    move = LIMITS.straight_move([1, 2, 3], [1, 2, 3], 4.0)
    assert move.duration == 0.0
    time, position = move.knots()
    np.testing.assert_array_equal(position, [[1, 2, 3]])
    assert time.tolist() == [0.0]


def simulate(rng, start_ns, latency):
    """A press of 1.5 mm at 0.5 mm/s, held 1 s, reported at 10 Hz through a link of that latency [s]."""
    down = LIMITS.straight_move([0, 0, 0.5], [0, 0, -1.0], 0.5)
    end = start_ns + round(down.duration * 1e9)
    press = Command("press", down.start, down.target, 0.5, 0.0, start_ns - 6_000_000, start_ns + 4_000_000)
    hold = Command("hold", down.target, down.target, 0.0, 1.0, press.acknowledged_ns, end + 1_012_000_000)
    sent = np.arange(start_ns - 300_000_000, hold.acknowledged_ns, 100_000_000) + rng.integers(0, 30_000_000)
    delay = np.rint(rng.uniform(0.002, latency, (2, len(sent))) * 1e9).astype(np.int64)
    true = sent + delay[0]
    z = 0.5 - down.distance((true - start_ns) / 1e9)
    position = np.stack([0 * z, 0 * z, np.round(z, 3)], axis=-1)
    arrival = true + delay[1]
    stream = CncStream(arrival, (sent + arrival) // 2, position, ("Run",) * len(sent))
    return [press, hold], StatusTimes(sent, stream), down


@pytest.mark.parametrize("seed", range(5))
def test_anchoring_finds_the_start_within_its_stated_uncertainty(seed):
    rng = np.random.default_rng(seed)
    commands, statuses, _ = simulate(rng, T0, 0.012)
    (move,) = anchor(commands, statuses, LIMITS)
    assert move.contradiction_ns == 0
    assert abs(move.start_ns - T0) <= move.uncertainty_ns + 1
    assert move.uncertainty_ns < 8_000_000
    # the depth while pressing at 0.5 mm/s is then known to 4 micrometres
    assert move.uncertainty_ns * 1e-9 * 0.5 < 0.004


def test_reports_bound_the_start_to_their_last_digit_and_a_step():
    fine = report_resolution({"$100": "80", "$101": "80", "$102": "400"})
    np.testing.assert_allclose(fine, [0.013, 0.013, 0.003])
    assert report_resolution({"$102": "400", "$13": "1"})[2] == pytest.approx(0.00127 + 0.0025)
    assert (report_resolution({}) > 0.0005).all()
    commands, statuses, _ = simulate(np.random.default_rng(3), T0, 0.004)
    late = replace(commands[0], sent_ns=T0 - 90_000_000, acknowledged_ns=T0 + 90_000_000)  # an `ok` that says little
    commands = [late, replace(commands[1], acknowledged_ns=commands[1].acknowledged_ns + 90_000_000)]
    coarse = anchor(commands, statuses, LIMITS, np.full(3, 0.05))
    (move,) = anchor(commands, statuses, LIMITS, fine)
    assert move.contradiction_ns == 0
    assert abs(move.start_ns - T0) <= move.uncertainty_ns < 20_000_000 < coarse[0].uncertainty_ns
    # A report that lies off the profile by more than a digit and a step contradicts it.
    position = statuses.stream.position + np.where(statuses.stream.position[:, 2:] < 0, 0.02, 0.0)
    off = StatusTimes(statuses.sent_ns, replace(statuses.stream, position=position))
    assert anchor(commands, off, LIMITS, fine)[0].contradiction_ns > 10_000_000


def test_controller_that_is_slower_than_its_settings_is_found_out():
    commands, statuses, _ = simulate(np.random.default_rng(0), T0, 0.012)
    wrong = AxisLimits(LIMITS.acceleration, np.array([50.0, 50.0, 0.4]))
    (move,) = anchor(commands, statuses, wrong)
    assert move.contradiction_ns > 100_000_000


def test_phases_meet_without_overlap_and_path_is_increasing():
    commands, statuses, down = simulate(np.random.default_rng(1), T0, 0.012)
    up = Command(
        "release",
        down.target,
        down.start,
        0.5,
        0.0,
        commands[1].acknowledged_ns,
        commands[1].acknowledged_ns + 8_000_000,
    )
    commands.append(up)
    moves = anchor(commands, statuses, LIMITS)
    found = phases(commands, moves)
    assert [p.name for p in found] == ["press", "hold", "release"]
    assert all(a.end_ns <= b.start_ns for a, b in pairwise(found))
    assert (found[1].end_ns - found[1].start_ns) / 1e9 == pytest.approx(1.0, abs=0.05)
    time, position = machine_path(moves, statuses.stream, complete=True)
    assert (np.diff(time) > 0).all()
    assert position[:, 2].min() == pytest.approx(-1.0)
    assert position[-1, 2] == pytest.approx(0.5)


def test_broken_off_press_follows_the_reports_instead_of_the_command():
    commands, statuses, down = simulate(np.random.default_rng(1), T0, 0.012)
    stream = statuses.stream
    held = np.array([0.0, 0.0, 0.123])
    halted = CncStream(stream.arrival_ns, stream.sample_ns, np.tile(held, (len(stream.arrival_ns), 1)), stream.state)
    moves = anchor(commands[:1], StatusTimes(statuses.sent_ns, halted), LIMITS)
    _, position = machine_path(moves, halted, complete=False)
    np.testing.assert_array_equal(np.unique(position, axis=0), held[None])
    assert down.target[2] == -1.0


@pytest.mark.parametrize(("clearance", "rate"), [(3.0, 8.0), (4.0, 5.0), (10.0, 8.0)])
def test_travel_is_stopped_within_the_clearance(clearance, rate):
    """A damaged line may send the tip straight down; the next report shows it, then the machine brakes."""
    motion = replace(plan().motion, clearance=clearance, travel_speed=100.0)
    speed = with_safe_travel(motion, LIMITS, rate).travel_speed
    unseen = 1 / rate + 0.1
    assert speed * unseen + speed**2 / (2 * LIMITS.acceleration.min()) == pytest.approx(clearance)
    slow = replace(motion, travel_speed=2.0)
    assert with_safe_travel(slow, LIMITS, rate) == slow
