"""What has no form of the library raises an alarm that says what and where; ordinary recordings raise none."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.chain.memory import low_pass
from tacdata.discrepancy.alarms.all_alarms import alarms
from tacdata.discrepancy.alarms.press_depths import reasoned, stretch, two_groups
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.problem import prepare
from tacdata.effects import library

IDLE = 5000.0
MOVING = 0.05


def seen(made, form_error=0.0):
    """Return what the residual of a fitted response shows, in words."""
    setting = Setting(made, FittedResponse(made), library())
    return [alarm.seen for alarm in alarms(prepare(setting, null_model(setting)), form_error)]


def changed(made, change):
    """Return a course whose readings were changed at the rows that were read: the rows' course in, readings out."""
    readings = made.readings.copy()
    readings[made.read] = change(made.reduced, made.speed[made.read][:, None])
    return replace(made, readings=readings)


def test_ordinary_presses_raise_hardly_any():
    """Five tests at a level of 1 in 1,000: more than one in twelve is no chance (2 in 1,000)."""
    raised = [seen(course(seed=seed, episodes=30, noise=noise)) for seed in range(6) for noise in (0.5, 3.0)]
    assert sum(bool(words) for words in raised) <= 1, raised


def test_what_a_cable_adds_is_seen_on_its_channels():
    def pulled(rows, speed):
        return rows.readings + 0.8 * np.sign(speed) * [1.0, -1.0, 0.1]

    [words] = seen(changed(course(episodes=30), pulled))
    assert words.startswith("channels move with the path whatever presses them")
    assert "loading or unloading" in words and ", on channel" in words
    assert set(words.split("rise, on ")[1].split(", ")[:2]) == {"channel 0", "channel 1"}
    large = float(words.split("the largest change is about ")[1].split()[0])
    assert large == pytest.approx(0.8, rel=0.4), "as large as it is"


def test_an_order_of_reading_that_turns_around_is_seen_with_the_time():
    def turned(rows, speed):
        rate = np.gradient(rows.readings, axis=0) / np.maximum(rows.step, 1e-3)[:, None]
        rate[rows.first] = 0.0
        later = np.where(rows.time > 0.5 * rows.time[-1], 1.0, -1.0)[:, None]
        return rows.readings + 0.006 * rate * later * [1.0, 0.0, -1.0]

    words = seen(changed(course(episodes=30, noise=0.5), turned))
    assert any("goes with the time" in said for said in words)


def test_what_an_effects_own_law_may_leave_is_no_alarm():
    """Creep of which channels have unlike shares leaves each a little of its own."""

    def settled(rows, speed):
        late = low_pass(rows.tip[:, 2], rows.step, 6.0)[:, None]
        return rows.readings + 1.5 * late * [1.0, -1.0, 0.3]

    made = changed(course(episodes=30), settled)
    power = float(np.square(1.5 * low_pass(made.tip[:, 2], made.step, 6.0)).sum())
    assert any("each its own way" in words for words in seen(made))
    assert any("each its own way" in words for words in seen(made, 0.01 * power)), "far more than a law may leave"
    assert not any("each its own way" in words for words in seen(made, 10 * power))


def saw(rows, share, seed=0):
    """Return readings with a saw tooth of the load every 0.1 mm, which begins anew in each press."""
    rng = np.random.default_rng(seed)
    way = np.abs(np.diff(rows.tip[:, 2], prepend=rows.tip[0, 2])) / 0.1
    phase = np.cumsum(np.where(rows.first, 3 * rng.random(len(way)), way))[:, None] % 1.0
    return rows.readings + share * (rows.readings - IDLE) * (phase - 0.5)


def test_stick_slip_is_seen_though_its_mean_over_presses_is_nothing():
    [words] = seen(changed(course(episodes=40, rates=(0.3, 0.6)), lambda rows, speed: saw(rows, 0.03)))
    assert "swing together along the path" in words
    every = float(words.split("every ")[1].split()[0])
    assert any(every == pytest.approx(0.1 / k, rel=0.12) for k in (1, 2)), "the tooth, or a half of it"


def hummed(where):
    def change(rows, speed):
        there = where(np.abs(speed) > MOVING)
        return rows.readings + 1.0 * there * np.sin(2 * np.pi * 4.3 * rows.time[:, None] + np.arange(3))

    return changed(course(episodes=40, rates=(0.3, 0.6, 1.3), noise=2.0), change)


def test_a_motor_is_heard_while_the_path_moves():
    [words] = seen(hummed(lambda moving: moving))
    assert "while the path moves and not while it stands" in words
    assert float(words.split("swing at ")[1].split()[0]) == pytest.approx(4.3, abs=0.1)


def test_hum_that_never_stops_is_no_motor():
    assert not any("while the path moves" in words for words in seen(hummed(np.ones_like)))


@pytest.mark.parametrize("hertz", [1.3, 4.3])
def test_hum_of_two_hundredths_of_full_scale_on_one_channel_is_seen_at_rest(hertz):
    def hum(rows, speed):
        full = np.ptp(rows.readings[:, 1])
        return rows.readings + 0.02 * full * np.sin(2 * np.pi * hertz * rows.time[:, None]) * [0.0, 1.0, 0.0]

    words = [said for said in seen(changed(course(episodes=40, rates=(0.3, 0.6, 1.3)), hum)) if "stands" in said]
    assert len(words) == 1 and "while the path stands" in words[0] and "rise, on channel 1" in words[0]
    assert float(words[0].split("swing at ")[1].split()[0]) == pytest.approx(hertz, abs=0.1)


def test_presses_that_lost_depth_and_found_it_are_told_with_their_size():
    made = course(episodes=40, rates=(0.5, 1.0))
    lost = (made.episode >= 14) & (made.episode < 24)
    moved = replace(made, tip=made.tip + np.where(lost, 0.03, 0.0)[:, None] * [0, 0, 1])
    [words] = seen(moved)
    assert words.startswith("from press 14 to press 23 presses go") and "less deep" in words and "comes back" in words
    least = float(words.split("at least ")[1].split()[0])
    assert 0.01 < least < 0.03, "the fitted response takes up a part"


def test_a_stretch_is_found_beside_levels_of_places_and_not_without_one():
    rng = np.random.default_rng(3)
    place = rng.integers(0, 5, 60)
    depth = rng.normal(size=60) + 3.0 * place
    assert stretch(depth, place) is None
    depth[20:35] -= 4.0
    found = stretch(depth, place)
    assert found is not None
    begin, end, by = found
    assert abs(begin - 20) <= 1 and abs(end - 35) <= 1 and by == pytest.approx(-4.0, abs=1.0)


def test_two_groups_are_told_from_one_of_the_same_spread():
    """Of one normal group no more than 1 in 100 draws is split."""
    rng = np.random.default_rng(5)
    error = np.full(44, 0.2)
    alone = sum(two_groups(rng.normal(size=44), error) is not None for _ in range(300))
    assert alone <= 3
    split = rng.random(44) < 0.5
    found = two_groups(0.25 * rng.normal(size=44) + 2.0 * split, error)
    assert found is not None and np.array_equal(found[0], ~split) and found[1] == pytest.approx(2.0, abs=0.3)


def test_groups_that_a_place_explains_have_a_reason():
    made = course(episodes=40)
    every = np.arange(40)
    assert reasoned(made, every, made.site == 0)
    assert not reasoned(made, every, np.random.default_rng(1).random(40) < 0.5)
