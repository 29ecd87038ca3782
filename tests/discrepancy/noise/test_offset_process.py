"""How offsets are trusted: a wander's own slope must not pass for drift, and a real drift must stay one."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.discrepancy.noise.offset_process import offset_process

ROWS = 20
"""Quiet rows an episode."""
APART = 6.0
"""Time between episodes [s]."""


def course(count):
    """Return what of a course is asked: every second row presses."""
    episode = np.repeat(np.arange(count), 2 * ROWS)
    depth = np.tile(np.repeat([-0.3, 1.0], ROWS), count)
    return SimpleNamespace(
        episode=episode,
        episodes=count,
        time=APART * episode + np.tile(np.linspace(0, 3, 2 * ROWS), count),
        tip=np.column_stack([0 * depth, 0 * depth, depth]),
        stroke=1.3,
        channels=24,
        rows=len(depth),
        temperature=None,
        read=np.arange(len(depth)),
        readings=np.full((len(depth), 24), 9000.0),
        averaged=np.ones(len(depth)),
    )


def followed(rng, count, length, spread):
    """Return an Ornstein-Uhlenbeck process as it goes on, shape (rows, 24); a length of 0: a number an episode."""
    c = course(count)
    if not length:
        return spread * rng.normal(size=(count, 24))[c.episode]
    made, now = np.empty((len(c.time), 24)), rng.normal(size=24)
    for k, step in enumerate(np.diff(c.time, prepend=c.time[0])):
        keep = np.exp(-step / length)
        now = keep * now + np.sqrt(1 - keep**2) * rng.normal(size=24)
        made[k] = now
    return spread * made


def slope_score(offsets, rng, levels=None):
    """Return the standard normal score of a drift in each channel, by innovations, shape (24,), and what was told."""
    count = len(offsets) // (2 * ROWS)
    c = course(count)
    read = offsets + rng.normal(size=offsets.shape)
    none = np.zeros(count, dtype=np.int64)
    told = offset_process(read, c, np.ones(24), 0.0, levels or [none])
    assert told is not None
    clock = (np.arange(count) - count / 2)[c.episode][:, None, None] * np.ones((1, 24, 1))
    means = np.stack([read[(c.episode == e) & (told.quiet > 0)].mean(axis=0) for e in range(count)])
    line = (np.arange(count) - count / 2)[:, None]
    left, way = means - told.expected(read[:, :, None])[:, :, 0], line - told.expected(clock)[:, :1, 0]
    weight = 1 / (told.spread**2 + 1 / ROWS)[:, None]
    power = (weight * way**2).sum()
    return (weight * way * left).sum(axis=0) / np.sqrt(power), told


@pytest.mark.parametrize("length", [0.0, 5.0, 40.0, 300.0])
@pytest.mark.parametrize("count", [12, 48])
def test_slopes_of_a_wander_are_as_uncertain_as_it_says(count, length):
    rng = np.random.default_rng(1)
    scores = np.concatenate([slope_score(followed(rng, count, length, 0.5), rng)[0] for _ in range(5)])
    # 1 if all is known; on the safe side where a slow wander cannot be told from a slower one, but for few episodes.
    assert 0.35 < np.std(scores) < 1.4


def test_independent_offsets_leave_a_drift_as_clear_as_least_squares_does():
    rng, count = np.random.default_rng(2), 48
    line = np.arange(count) - count / 2
    sure = 0.3 / np.sqrt(np.sum((line - line.mean()) ** 2))  # offsets of 0.3, which are hardly read worse
    scores, told = slope_score(0.3 * followed(rng, count, 0.0, 1.0) + 6 * sure * line[course(count).episode, None], rng)
    assert np.median(scores) == pytest.approx(6 * 0.3 / np.hypot(0.3, 1 / np.sqrt(ROWS)), rel=0.2)
    assert told.spread[-1] == pytest.approx(0.3, rel=0.2)


def test_what_came_before_says_what_comes():
    rng, count = np.random.default_rng(3), 60
    _, told = slope_score(followed(rng, count, 40.0, 1.0), rng)
    # The next value of the process varies by sqrt(1 - exp(-2 dt / tau)) around the last one.
    assert told.spread[20:] == pytest.approx(np.sqrt(1 - np.exp(-2 * APART / 40)), rel=0.25)
    assert np.allclose(told.weights, np.tril(told.weights, -1))


def test_what_all_channels_share_or_warmth_moves_is_no_wander():
    count, quick = 48, 20.0
    wander = followed(np.random.default_rng(6), count, quick, 0.5)
    c = course(count)
    settling = 8 * np.exp(-c.time / 80)[:, None]
    warmth = np.sin(c.time / 50)[:, None] * np.linspace(-3, 3, 24)

    def told(read, temperature=None):
        c.temperature = temperature
        noise = np.random.default_rng(7).normal(size=read.shape)
        return offset_process(read + noise, c, np.ones(24), 0.0, [np.zeros(count, dtype=np.int64)])

    bare = np.median(told(wander).variance - 1e6)
    assert np.median(told(wander + settling).variance - 1e6) == pytest.approx(bare, rel=1e-3)
    assert np.median(told(wander + warmth, np.sin(c.time / 50)).variance - 1e6) < 1.3 * bare
    assert np.median(told(wander + warmth).variance - 1e6) > 2 * bare


def test_a_place_keeps_its_level_to_itself():
    """A constant of one place is taken off that place alone, and all of it from its second visit on."""
    rng, count = np.random.default_rng(4), 24
    place = np.arange(count) % 3
    _, told = slope_score(followed(rng, count, 40.0, 0.5), rng, [np.zeros(count, dtype=np.int64), place])
    c = course(count)
    level = (place == 1)[c.episode][:, None, None].astype(float)
    expected = told.expected(level)[:, 0, 0]
    later = np.arange(count) > 3
    assert expected[later & (place == 1)] == pytest.approx(1.0, abs=1e-3)
    assert expected[later & (place != 1)] == pytest.approx(0.0, abs=1e-3)


def test_episodes_left_out_say_nothing_and_the_others_go_on():
    rng, count = np.random.default_rng(5), 30
    _, told = slope_score(followed(rng, count, 40.0, 0.5), rng)
    kept = np.setdiff1d(np.arange(count), [3, 4, 11])
    rows = np.isin(told.episode, kept)
    unread, renumbered = told.of(rows), told.of(rows, kept)
    assert np.all(unread.weights[:, [3, 4, 11]] == 0)
    assert unread.weights[np.ix_(kept, kept)] == pytest.approx(renumbered.weights, abs=1e-6)
    assert unread.spread[kept] == pytest.approx(renumbered.spread, rel=1e-4)
    assert renumbered.expected(np.ones((rows.sum(), 2, 1))).shape == (len(kept), 2, 1)


def test_few_episodes_tell_no_wander():
    c = course(4)
    assert offset_process(np.zeros((len(c.episode), 24)), c, np.ones(24), 0.0, [np.zeros(4, dtype=np.int64)]) is None


@pytest.mark.parametrize("common, larger", [(0.0, 1.0), (3.0, 8.0)])
def test_what_all_channels_wander_together_counts_in_full(common, larger):
    """Variances of what channels share are those of the process alone where it is not common."""
    count, rng = 60, np.random.default_rng(11)
    c = course(count)
    wander = followed(np.random.default_rng(6), count, 20.0, 0.5)
    together = followed(np.random.default_rng(9), count, 20.0, common / np.sqrt(24))[:, :1]
    noise = rng.normal(size=wander.shape)
    none = [np.zeros(count, dtype=np.int64)]
    alone = offset_process(wander + noise, c, np.ones(24), 0.0, none)
    both = offset_process(wander + together + noise, c, np.ones(24), 0.0, none)
    grown = np.median((both.variance - 1e6) / (alone.variance - 1e6))
    assert grown == pytest.approx(1.0) if larger == 1.0 else grown > 1.5
