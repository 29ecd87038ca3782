"""Scores over episodes: honest where nothing is hidden, powerful for what follows the clock."""

import numpy as np

from tacdata.discrepancy.clusters import clustered
from tacdata.discrepancy.fit import flips


def grams(rng, columns, noise):
    """Return Gram matrices of episodes whose residual is ``noise`` (episodes,), whose column is ``columns``."""
    made = np.zeros((len(columns), 2, 2))
    information = 40.0 * columns**2
    made[:, 1, 1] = information
    made[:, 0, 1] = made[:, 1, 0] = 40.0 * columns * noise + np.sqrt(information) * rng.normal(size=len(columns))
    made[:, 0, 0] = 300.0
    return made


def slow(rng, n, memory):
    result = np.zeros(n)
    for i in range(1, n):
        result[i] = memory * result[i - 1] + np.sqrt(1 - memory**2) * rng.normal()
    return result


def test_a_slow_wander_is_seldom_taken_for_a_trend():
    trend = np.linspace(-1, 1, 48)
    rng = np.random.default_rng(1)
    found = [clustered(grams(rng, trend, slow(rng, 48, 0.8)), np.array([0]), True).score() for _ in range(300)]
    apart = [clustered(grams(rng, trend, slow(rng, 48, 0.8)), np.array([0]), False) for _ in range(100)]
    assert np.mean(np.array(found) > 2.33) < 0.08  # 0.01 if it had no memory at all; sign flips of episodes give 0.4
    assert np.mean([len(c.scatter) < 48 for c in apart]) > 0.9


def test_independent_episodes_give_the_stated_share_of_false_alarms():
    rng = np.random.default_rng(2)
    column = rng.uniform(0.2, 1.0, 30)
    found = [clustered(grams(rng, column, np.zeros(30)), np.array([0]), False).score() for _ in range(2000)]
    assert np.mean(np.array(found) > 1.645) < 0.075
    assert np.mean(np.array(found) > 1.645) > 0.02


def test_a_trend_is_far_beyond_all_flips_however_few_the_stretches():
    rng = np.random.default_rng(3)
    trend = np.linspace(-1, 1, 48)
    one = clustered(grams(rng, trend, 1.0 * trend), np.array([0]), True)
    assert one.score() > 5
    assert one.score() > one.by_chance(flips(48, 999)).max()


def test_what_a_single_stretch_says_is_not_judged():
    rng = np.random.default_rng(4)
    column = np.zeros(30)
    column[7] = 5.0
    assert clustered(grams(rng, column, 3 * column), np.array([0]), False).score() < 1
