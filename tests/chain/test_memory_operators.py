"""Operators with memory against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tacdata.chain.memory import (
    bends,
    dead_band,
    delayed,
    low_pass,
    low_pass_between,
    low_passes,
    play,
    running_max,
    second_order,
    slipping,
)


@pytest.mark.parametrize("tau", [0.02, 0.3, 5.0, 400.0])
def test_first_order_lag_of_a_ramp_is_exact_on_uneven_steps(tau):
    rng = np.random.default_rng(0)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 0.4, 500))])
    step = np.diff(time, prepend=time[0])
    expected = time - tau * -np.expm1(-time / tau)
    np.testing.assert_allclose(low_pass(time, step, tau), expected, atol=1e-9 * max(1, tau))


def test_lag_forgets_across_a_long_pause():
    time = np.concatenate([np.linspace(0, 1, 50), np.linspace(1e5, 1e5 + 1, 50)])
    values = np.concatenate([np.ones(50), np.zeros(50)])
    result = low_pass(values, np.diff(time, prepend=0.0), 0.5)
    assert np.abs(result[51:]).max() < 1e-3


@pytest.mark.parametrize("columns", [1, 7, 8, 25])
def test_several_lags_at_once_are_their_sum(columns):
    rng = np.random.default_rng(4)
    values, step = rng.normal(size=(300, columns)), rng.uniform(0.001, 0.4, 300)
    taus, shares = np.array([0.03, 0.5, 9.0]), np.array([0.5, 0.2, 0.3])
    expected = sum(share * low_pass(values, step, tau) for tau, share in zip(taus, shares, strict=True))
    np.testing.assert_allclose(low_passes(values, step, taus, shares), expected, atol=1e-13)
    alone = low_pass(values[:, 0], step, 0.5)
    np.testing.assert_array_equal(low_pass(values, step, 0.5)[:, 0], alone)


def bent():
    """Rows of uneven steps, and a load that grows ever faster."""
    time = np.concatenate([[0.0], np.cumsum(np.random.default_rng(5).uniform(0.005, 0.02, 200))])
    return time, np.diff(time, prepend=time[0]), 3 * time**2 + time


def test_a_filter_of_what_bends_between_rows_is_exact_for_a_parabola():
    time, step, load = bent()
    tau = 0.0065
    settled = load - tau * (6 * time + 1) + 6 * tau**2
    expected = settled - settled[0] * np.exp(-time / tau)
    np.testing.assert_allclose(low_pass_between(load[:, None], step, tau)[:, 0], expected, atol=1e-12)
    straight = low_pass(load, step, tau) - expected
    assert 1e-4 > straight[20:].mean() > 2e-5, "straight lines between rows are above it"


def test_a_delay_of_what_bends_between_rows_is_exact_for_a_parabola():
    time, _, load = bent()
    late = delayed(load[:, None], time, np.zeros(len(time), dtype=int), np.full(len(time), 0.013))[:, 0]
    then = time - 0.013
    np.testing.assert_allclose(late[5:], (3 * then**2 + then)[5:], atol=1e-12)


def test_beside_a_long_gap_nothing_bends():
    """A load that rises at once after a rest would swing far below before it."""
    time = np.array([0.0, 0.5, 1.0, 1.02, 1.04, 1.06, 1.08])
    load = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0])
    assert np.abs(bends(load[:, None], np.diff(time, prepend=0.0))).max() < 1e-9
    late = delayed(load[:, None], time, np.zeros(7, dtype=int), np.full(7, 0.1))
    assert late.min() >= 0.0
    np.testing.assert_allclose(bends((time**2)[3:, None], np.diff(time, prepend=0.0)[3:])[1:], 2.0)


@pytest.mark.parametrize("damping", [0.7, 0.99999, 1.0, 1.3])
def test_a_second_order_lag_follows_its_equation(damping):
    corners, path = [0.0, 0.3, 0.5, 0.55, 1.0], [0.0, 0.6, 0.6, 0.5, 0.5]
    time = np.unique(np.concatenate([corners, np.random.default_rng(6).uniform(0, 1, 120)]))
    tau = 0.03
    w = 2 * damping / tau

    def equation(t, state):
        return [state[1], w**2 * (np.interp(t, corners, path) - state[0] - tau * state[1])]

    expected = solve_ivp(equation, (0, 1), [0, 0], t_eval=time, max_step=5e-4, rtol=1e-8, atol=1e-10).y[0]
    found = second_order(np.interp(time, corners, path), np.diff(time, prepend=0.0), tau, damping)
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_play_follows_through_its_dead_band():
    depth = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)])
    out = play(depth, 0.1)
    np.testing.assert_allclose(out[:101], depth[:101] - 0.1)
    back = out[101:]
    np.testing.assert_allclose(back[depth[101:] > 0.8 + 1e-9], 0.9)
    assert back[-1] == pytest.approx(0.1)


def test_play_is_its_definition():
    values, width = np.cumsum(np.random.default_rng(1).normal(size=300)), 0.7
    expected = [values[0] - width]
    for u in values[1:]:
        expected.append(max(u - width, min(u + width, expected[-1])))
    np.testing.assert_array_equal(play(values, width), expected)


def test_play_begins_anew_where_it_forgets():
    values = np.cumsum(np.random.default_rng(2).normal(size=200))
    anew = np.arange(200) % 40 == 25
    expected = np.concatenate([play(part, 0.7) for part in np.split(values, np.flatnonzero(anew))])
    np.testing.assert_array_equal(play(values, 0.7, anew), expected)


def test_a_dead_band_leaves_alone_what_a_gauge_adds_to_a_path_that_stands():
    """Where the path moves, what follows is half the band behind; where it stands, it stands."""
    rng, noise, width = np.random.default_rng(3), 0.002, 0.001
    path = np.concatenate([np.linspace(0, 1, 200), np.ones(400), np.linspace(1, 0, 200)])
    read = path + noise * rng.normal(size=len(path))
    off = dead_band(read, width, noise)
    ramps = np.r_[20:200, 620:800]
    np.testing.assert_allclose(off[ramps], np.where(ramps < 300, -width, width), atol=1e-12)
    assert np.std(off[200:600]) < 0.1 * width
    assert np.std(play(read, width)[200:600] - read[200:600]) > 0.5 * width, "what is taken for motion does not"


def test_play_of_many_columns_is_that_of_each():
    values = np.cumsum(np.random.default_rng(0).normal(size=(200, 5)), axis=0)
    np.testing.assert_array_equal(play(values, 0.7), np.stack([play(c, 0.7) for c in values.T], axis=-1))


def test_delay_shifts_within_an_episode_only():
    time = np.concatenate([np.arange(10.0), 100 + np.arange(10.0)])
    episode = np.repeat([0, 1], 10)
    values = time[:, None].copy()
    late = delayed(values, time, episode, np.full(20, 2.5))
    np.testing.assert_allclose(late[3:10, 0], time[3:10] - 2.5)
    np.testing.assert_allclose(late[10:13, 0], 100.0)
    np.testing.assert_allclose(delayed(values, time, episode, np.zeros(20)), values)


def test_largest_so_far_is_kept_for_each_place():
    result = running_max(np.array([1.0, 5.0, 2.0, 3.0, 1.0]), np.array([0, 1, 0, 0, 1]))
    np.testing.assert_allclose(result, [1, 5, 2, 3, 5])


def test_friction_slips_gradually_and_begins_anew():
    """Against small steps of the equation, up, down and up again; another stroke starts from rest."""
    turns = np.concatenate([np.linspace(0, 1, 41), np.linspace(1, 0.4, 21)[1:], np.linspace(0.4, 0.9, 13)[1:]])
    fine = np.interp(np.linspace(0, len(turns) - 1, 200 * (len(turns) - 1) + 1), np.arange(len(turns)), turns)
    z, stepped = -1.0, [-1.0]
    for step in np.diff(fine):
        z += (step - abs(step) * z) / 0.2
        stepped.append(z)
    start = np.full(2 * len(turns), np.nan)
    start[[0, len(turns)]] = -1.0
    found = slipping(np.concatenate([turns, turns]), 0.2, start)
    np.testing.assert_allclose(found[: len(turns)], stepped[::200], atol=2e-3)
    np.testing.assert_array_equal(found[len(turns) :], found[: len(turns)])


@pytest.mark.parametrize("power", [0.02, 0.5, 1.0, 1.4])
def test_friction_behind_a_gap_is_zero_over_the_gap(power):
    """Against small steps of the equation, up and down, with a gap of 0.3 that is open at z = 0 alone."""
    turns = np.concatenate([np.linspace(0, 1, 21), np.linspace(1, 0.2, 17)[1:], np.linspace(0.2, 0.7, 11)[1:]])
    fine = np.interp(np.linspace(0, len(turns) - 1, 500 * (len(turns) - 1) + 1), np.arange(len(turns)), turns)
    z, crossed, stepped = -1.0, 0.0, [-1.0]
    for step in np.diff(fine):
        sign, room = np.sign(step), 0.3 - crossed if step > 0 else crossed
        if z * sign >= 0 and room > 0:
            z, crossed = 0.0, crossed + sign * min(abs(step), room)
        else:
            z = float(np.clip(z + sign * abs(step) * max(1 - sign * z, 0.0) ** power / 0.2, -1, 1))
        stepped.append(z)
    start = np.full(len(turns), np.nan)
    start[0] = -1.0
    np.testing.assert_allclose(slipping(turns, 0.2, start, 0.3, power), stepped[::500], atol=5e-3)
