"""Hum, jumps, wandering gains and swapped channels are told of, and ordinary recordings are left alone."""

from dataclasses import replace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.data.idle_lines import idle_lines
from tacdata.discrepancy.data.single_channels import odd_channels, press_gains
from tacdata.discrepancy.model.fitted_response import FittedResponse

IDLE = np.full(3, 5000.0)


def with_readings(made, change):
    """Return a course whose readings above idle were changed: time, episode and rises in, rises out."""
    return replace(made, readings=IDLE + change(made.time[:, None], made.episode[:, None], made.readings - IDLE))


def watched(made):
    return [*idle_lines(made), *odd_channels(made, FittedResponse(made))]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("truth", [{}, {"relaxed": 0.15, "hold": 4.0}, {"delay": 0.05}, {"play": 0.05}])
def test_ordinary_presses_are_left_alone(seed, truth):
    assert watched(course(seed=seed, **truth)) == []


def test_hum_is_told_of_with_its_frequency():
    """2 % of full scale at 9 Hz."""
    [words] = idle_lines(with_readings(course(), lambda t, e, r: r + 16 * np.sin(2 * np.pi * 9 * t)))
    hertz = float(words.split(" Hz")[0].split()[-1])
    assert hertz == pytest.approx(9, abs=1.1), "as fine as short stretches in the air allow"


def test_a_slow_recovery_is_no_hum():
    """After each press readings come back over half a second: a spectrum that falls from its lowest frequency on."""
    late = course(recovery=0.5, hold=3.0, relaxed=0.3, noise=0.5)
    assert idle_lines(late) == []


def test_a_channel_that_drops_by_a_quarter_and_heals_is_told_of():
    fallen = with_readings(course(), lambda t, e, r: r * np.where((e >= 8) & (e < 14), [1, 0.75, 1], 1.0))
    [words] = odd_channels(fallen, FittedResponse(fallen))
    assert words.startswith("channel 1: reads 2") and "press 8 to press 13 and comes back" in words


def test_a_gain_that_wanders_is_told_of():
    moved = with_readings(course(noise=0.5), lambda t, e, r: r * (1 + np.array([0, 0, 0.08]) * np.sin(e / 4)))
    [words] = odd_channels(moved, FittedResponse(moved))
    assert words.startswith("channel 2: its gain wanders by")


def test_friction_that_slow_presses_begin_with_turns_no_channel():
    """Slow presses are in motion for more of their first rows, so their level holds the friction."""
    made = course(noise=0.5)
    rows = [np.flatnonzero(made.episode == e) for e in np.unique(made.episode)]
    early = np.concatenate([r[: len(r) // 10 + 1] for r in rows[:9]])
    offset = np.zeros((len(made.time), 1))
    offset[early] = np.nanmax(np.abs(made.readings - IDLE))
    said = odd_channels(replace(made, readings=made.readings + offset), FittedResponse(made))
    assert not any("other sign" in words for words in said)


def test_channels_that_change_places_are_told_of():
    made = course()
    swapped = with_readings(made, lambda t, e, r: np.where(e >= 17, r[:, [2, 1, 0]], r))
    words = odd_channels(swapped, FittedResponse(made))
    assert any("channel 0 and channel 2 read as one another from press 17" in said for said in words)


@pytest.mark.parametrize("begin", [12, 17])
def test_a_lead_that_was_turned_is_told_of_and_nothing_else(begin):
    """Half way, too, where a response that is fitted to both halves is none."""
    turned = with_readings(course(), lambda t, e, r: np.where(e >= begin, r * [1, -1, 1], r))
    [words] = odd_channels(turned, FittedResponse(turned))
    assert words.startswith(f"channel 1: reads with the other sign from press {begin} on")


def test_what_is_hardly_more_than_noise_has_no_sign():
    made = course()
    rise = made.readings[:, 1:2] - IDLE[1]
    small = np.column_stack([made.readings[:, 0], IDLE[1] + 0.008 * rise[:, 0], made.readings[:, 2]])
    weak = replace(made, readings=small + np.random.default_rng(1).normal(0, 3, small.shape))
    turned = with_readings(weak, lambda t, e, r: np.where(e >= 12, r * [1, -1, 1], r))
    assert not any("other sign" in words for words in odd_channels(turned, FittedResponse(turned)))


def test_a_channel_without_others_is_unlike_none():
    moved = with_readings(course(noise=0.5), lambda t, e, r: r * (1 + np.array([0, 0, 0.08]) * np.sin(e / 4)))
    alone = replace(moved, readings=moved.readings[:, 2:], numbers=())
    assert odd_channels(alone, FittedResponse(alone)) == []


def test_a_channel_that_no_press_stirs_has_no_gain():
    still = [np.zeros((9, 2)) for _ in range(4)]
    with np.errstate(all="raise"):
        assert np.isnan(press_gains(still, still)).all()
