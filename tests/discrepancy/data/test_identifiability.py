"""Which ways of pressing can tell mechanisms of rate apart; what is told of them where the path itself is measured."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.identifiability import lookalikes
from tacdata.discrepancy.data.sufficiency import limitations, one_rate
from tacdata.discrepancy.data.tip_motion import longest_hold, speeds, stairs
from tacdata.effects import load


def test_two_rates_of_pressing_are_told_from_one():
    assert one_rate(course(rates=(1.0,)))
    assert not one_rate(course(rates=(0.5, 2.0)))
    assert lookalikes(course(rates=(0.5, 2.0)), load("backlash"), {}) == ()
    assert "latency" in lookalikes(course(rates=(1.0,)), load("backlash"), {})


def test_the_way_to_the_skin_does_not_count_as_pressing():
    """Half of the episodes come ten times as fast, or all: what presses is as it was."""
    for pressed, same in (((1.0,), True), ((0.5, 2.0), False)):
        made = course(rates=pressed)
        for fast in (made.episode % 2 == 0, made.episode >= 0):
            tip = made.tip.copy()
            tip[fast & (tip[:, 2] < 0), 2] *= 10
            assert one_rate(replace(made, tip=tip)) == same


def test_a_session_that_never_touches_has_one_rate():
    made = course()
    assert one_rate(replace(made, tip=made.tip - np.array([0, 0, 5.0])))


def measured(made, seed=0, noise=5e-4, quantum=1e-3):
    """Return the course with a path as a gauge reads it."""
    tip = made.tip.copy()
    tip[:, 2] = np.round((tip[:, 2] + noise * np.random.default_rng(seed).normal(size=len(tip))) / quantum) * quantum
    return replace(made, tip=tip)


def test_a_hold_is_told_from_a_path_with_noise():
    held = course(hold=1.5, episodes=8)
    assert held.dither == 0, "a commanded path has none"
    assert measured(held).dither == pytest.approx(6e-4, rel=0.4)
    assert np.array_equal(measured(held).dithers[:2], [0, 0]), "each axis has its own"
    for made in (held, measured(held)):
        assert longest_hold(made) == pytest.approx(1.5, abs=0.1)
        assert not any("no hold" in words for words in limitations(made))
    for made in (course(hold=0.3, episodes=8), measured(course(hold=0.3, episodes=8))):
        assert longest_hold(made) < 0.4
        assert any("no hold" in words for words in limitations(made))
    slow = course(rates=(0.002,), hold=0.0, episodes=1)
    assert longest_hold(slow) == 0 == longest_hold(measured(slow)), "who presses slowly does not stand"
    assert "relaxation" not in lookalikes(measured(course(rates=(1.0,), hold=1.5)), load("backlash"), {})
    assert "relaxation" in lookalikes(measured(course(rates=(1.0,), hold=0.1)), load("backlash"), {})
    held = measured(course(rates=(1.0,), hold=1.5))
    assert lookalikes(held, load("relaxation"), {"tau": 0.5}) == ()
    assert "hysteresis" in lookalikes(held, load("relaxation"), {"tau": 4.0})


def test_quick_relaxation_at_one_rate_may_be_a_lag():
    """A relaxation of 0.1 s beside a press of a second is a lag of the other sign; two rates split them."""
    held = course(rates=(1.0,), hold=1.5)
    assert "latency" in lookalikes(held, load("relaxation_read"), {"tau": 0.1})
    assert lookalikes(held, load("relaxation_read"), {"tau": 0.5}) == ()
    assert lookalikes(course(rates=(0.5, 2.0), hold=1.5), load("relaxation_read"), {"tau": 0.1}) == ()


def stepped(pressing, letting_go, hold=2.0):
    """Return presses at their own rates, let go of at one or several [mm/s]; the depth read with noise."""
    made, parts = course(episodes=len(pressing)), []
    for k, (down, up) in enumerate(zip(pressing, letting_go, strict=True)):
        at = np.cumsum([0, 1.0, 1.5 / down, hold, 1.5 / up, 1.0])
        time = np.arange(0, at[-1], 0.02)
        parts.append((time, np.full(len(time), k), np.interp(time, at, [-0.5, -0.5, 1.0, 1.0, -0.5, -0.5])))
    rows = sum(len(time) for time, _, _ in parts)
    tip = np.zeros((rows, 3))
    tip[:, 2] = np.concatenate([depth for _, _, depth in parts])
    last = np.cumsum([0, *(time[-1] + 5 for time, _, _ in parts[:-1])])
    whole = replace(
        made,
        time=np.concatenate([t + begin for (t, _, _), begin in zip(parts, last, strict=True)]),
        tip=tip,
        episode=np.concatenate([e for _, e, _ in parts]),
        tool=np.zeros(rows, dtype=int),
        readings=np.zeros((rows, 3)),
        averaged=np.ones(rows),
    )
    return measured(whole)


def test_rates_of_pressing_and_of_letting_go_count_apart():
    """Two rates of pressing and one, faster, of letting go are not one rate; nor is the other way round."""
    slow_and_fast, one = [0.5, 4.0] * 4, [4.0] * 8
    down, up = speeds(stepped(slow_and_fast, one))
    assert down == pytest.approx(np.array(slow_and_fast), rel=0.05) and up == pytest.approx(np.array(one), rel=0.05)
    assert not one_rate(stepped(slow_and_fast, one))
    assert not one_rate(stepped(one, slow_and_fast))
    assert one_rate(stepped(one, one)) and one_rate(stepped(one, [0.5] * 8))


def test_presses_spaced_evenly_do_not_tell_what_they_do_from_what_time_does():
    made = course()
    first = np.flatnonzero(made.first)
    one = replace(made, site=np.zeros(made.episodes, dtype=int))
    begins = 50.0 * np.arange(made.episodes)
    even = replace(one, time=one.time - one.time[first][one.episode] + begins[one.episode])
    assert lookalikes(even, load("wear_in"), {}) == ("gain_drift",)
    assert lookalikes(even, load("softening"), {}) == ()
    assert lookalikes(even, load("settling_gain"), {}) == ("softening",)
    rested = replace(even, time=even.time + 2000.0 * (even.episode >= made.episodes // 2))
    assert lookalikes(rested, load("wear_in"), {}) == ()


def staircase(stop):
    """Return a course of one rate that stops at four depths on the way in and out, for ``stop`` seconds each."""
    made = course(episodes=4)
    levels = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0])
    corners = np.repeat(levels, 2)[1:-1]
    at = np.cumsum([0.0, *np.where(np.diff(corners) == 0, stop, 0.2)])
    time = np.arange(0.0, at[-1], 0.02)
    parts = np.tile(np.interp(time, at, corners), 4)
    rows = len(time)
    clock = np.concatenate([time + k * (at[-1] + 5.0) for k in range(4)])
    tip = np.column_stack([0 * parts, 0 * parts, parts])
    return replace(
        made,
        time=clock,
        tip=tip,
        tool=np.zeros(4 * rows, dtype=int),
        readings=np.zeros((4 * rows, 3)),
        averaged=np.zeros(4 * rows, dtype=bool),
        episode=np.repeat(np.arange(4), rows),
    )


def test_a_staircase_of_one_rate_tells_what_stays_from_what_catches_up():
    long, short = staircase(1.2), staircase(0.6)
    assert stairs(long) and stairs(short) and not stairs(course()) and not stairs(staircase(0.2))
    assert lookalikes(long, load("hysteresis"), {}) == ()
    assert set(lookalikes(short, load("hysteresis"), {})) == {"creep", "relaxation"}
    assert set(lookalikes(long, load("latency"), {})) == {"low_pass_filter", "servo_lag"}
    assert {"latency", "creep"} <= set(lookalikes(course(rates=(1.0,)), load("viscosity"), {}))
    assert lookalikes(long, load("relaxation"), {"tau": 0.5}) == ()
    assert "hysteresis" in lookalikes(long, load("relaxation"), {"tau": 6.0})


def test_a_lag_that_is_over_in_a_hold_is_of_its_family():
    """At one rate play is still behind at the end of a hold, what relaxes falls; a short hold tells neither."""
    kin = {"low_pass_filter", "servo_lag"}
    assert set(lookalikes(course(rates=(1.0,), hold=1.5), load("latency"), {"L": 0.1})) == kin
    for late, hold, other in ((0.1, 0.4, "backlash"), (0.6, 1.5, "backlash"), (-0.1, 1.5, "viscosity")):
        found = set(lookalikes(course(rates=(1.0,), hold=hold), load("latency"), {"L": late}))
        assert {*kin, other} < found
    assert "backlash" in lookalikes(course(rates=(1.0,), hold=1.5), load("low_pass_filter"), {"tau": 0.6})


def test_two_delays_that_hardly_differ_may_be_a_filter():
    """A filter rounds both edges: one time does not fit them, and two do."""
    made, either_way = course(rates=(0.5, 2.0)), load("latency_either_way")
    assert "low_pass_filter" in lookalikes(made, either_way, {"L_in": 0.050, "L_out": 0.052})
    assert lookalikes(made, either_way, {"L_in": 0.05, "L_out": 0.2}) == ()
    assert lookalikes(made, load("latency"), {"L": 0.05}) == ()
