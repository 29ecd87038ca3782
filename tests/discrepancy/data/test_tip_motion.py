"""Rates and holds of presses, where the path itself is measured."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.sufficiency import limitations, one_rate
from tacdata.discrepancy.data.tip_motion import longest_hold, speeds


def test_two_rates_of_pressing_are_told_from_one():
    assert one_rate(course(rates=(1.0,)))
    assert not one_rate(course(rates=(0.5, 2.0)))


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
