"""Motion in closed form."""

import math

import numpy as np
import pytest

from tacdata.virtual_rig.firmware.planner import Block, Planner, axis_limit

S = 1_000_000_000


def block(start, end, speed=10.0, acceleration=100.0):
    return Block(np.array(start, float), np.array(end, float), speed, acceleration)


def test_trapezoid_takes_length_over_speed_plus_ramp():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [0, 0, -20]), 5 * S)
    end = planner.next_end()
    assert end is not None
    assert (end - 5 * S) / S == pytest.approx(20 / 10 + 10 / 100)
    assert planner.position(5 * S) == pytest.approx([0, 0, 0])
    assert planner.position(5 * S + S // 10) == pytest.approx([0, 0, -0.5])
    assert planner.position(end) == pytest.approx([0, 0, -20])
    assert planner.speed(6 * S) == pytest.approx(10)
    assert not planner.moving(end)


def test_short_move_never_reaches_its_speed():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [0.25, 0, 0]), 0)
    assert planner.next_end() == pytest.approx(2 * math.sqrt(0.25 / 100) * S, rel=1e-6)
    assert planner.speed(S // 20) == pytest.approx(5.0, rel=1e-6)


def test_in_line_blocks_keep_speed_and_corners_stop():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [0, 0, -10], 10), 0)
    planner.add(block([0, 0, -10], [0, 0, -12], 2), S // 2)
    planner.add(block([0, 0, -12], [5, 0, -12], 10), S // 2)
    times = np.arange(0, 4 * S, S // 1000)
    path = np.array([planner.position(t) for t in times])
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) * 1000
    at_junction = speed[np.argmin(np.abs(path[:-1, 2] + 10))]
    assert at_junction == pytest.approx(2.0, abs=0.15)
    assert speed[np.argmin(np.abs(path[:-1, 2] + 11.9999) + path[:-1, 0])] < 0.3
    assert np.abs(np.diff(speed)).max() < 100 / 1000 * 1.05  # never above the acceleration limit
    assert path[-1] == pytest.approx([5, 0, -12])


def test_hold_brakes_within_its_distance_and_resume_arrives():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [20, 0, 0]), 0)
    planner.hold(S)
    rest = planner.next_end()
    assert rest is not None
    at_rest = planner.position(rest)
    assert at_rest[0] - planner.position(S)[0] == pytest.approx(10**2 / 2 / 100)
    assert planner.position(rest + 60 * S) == pytest.approx(at_rest)
    planner.resume(rest + 10 * S)
    end = planner.next_end()
    assert end is not None
    assert planner.position(end) == pytest.approx([20, 0, 0])
    assert (end - rest - 10 * S) / S == pytest.approx((20 - at_rest[0]) / 10 + 0.1)
    assert planner.position(S // 2)[0] == pytest.approx(4.5)  # the past stays


def test_hold_across_an_in_line_junction():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [10, 0, 0]), 0)
    planner.add(block([10, 0, 0], [20, 0, 0]), 0)
    planner.hold(S)  # at 9.5 mm, 10 mm/s: rest at 10 mm
    rest = planner.next_end()
    assert rest is not None
    assert planner.position(10 * S)[0] == pytest.approx(10.0, abs=1e-6)
    planner.resume(10 * S)
    assert planner.position(20 * S)[0] == pytest.approx(20.0)


def test_stop_forgets_the_queue():
    planner = Planner(np.zeros(3))
    planner.add(block([0, 0, 0], [20, 0, 0]), 0)
    assert planner.stop(S)
    assert planner.retire(S) == 0
    assert planner.position(9 * S)[0] == pytest.approx(9.5)
    assert planner.target == pytest.approx([9.5, 0, 0])


def test_axis_limit_is_that_of_the_weakest_axis():
    assert axis_limit(np.array([0.6, 0.0, 0.8]), np.array([60.0, 1.0, 8.0])) == pytest.approx(10.0)
