"""Scores of chance: normal for few episodes and many, whatever each episode's size is."""

import numpy as np
import pytest
from scipy.stats import kstest

from tacdata.discrepancy.statistics.cluster_robust import (
    ClusteredScore,
    PooledExcess,
    clustered_score,
    pooled_by_kind,
    pooled_excess,
)


def gram_of(rng, episodes, tails):
    """Return Gram matrices of one column and noise whose size differs from episode to episode."""
    size = rng.gamma(2.0, size=episodes)
    kick = rng.standard_t(3, episodes) if tails else rng.normal(size=episodes)
    gram = np.zeros((episodes, 2, 2))
    gram[:, 1, 1] = size
    gram[:, 0, 1] = gram[:, 1, 0] = np.sqrt(size) * kick
    return gram


@pytest.mark.parametrize("episodes", [12, 40])
@pytest.mark.parametrize("tails", [False, True])
def test_scores_without_an_effect_are_no_larger_than_normal_ones(episodes, tails):
    rng = np.random.default_rng(3)
    z = np.array([clustered_score(gram_of(rng, episodes, tails), np.array([0])).z_score() for _ in range(2000)])
    for level, normal in ((0.05, 1.645), (0.01, 2.326)):
        assert np.mean(z > normal) < 1.6 * level


def test_null_draws_of_few_episodes_reach_as_far_as_chance_does():
    rng = np.random.default_rng(4)
    scores = clustered_score(gram_of(rng, 9, False), np.array([0]))
    z = scores.bootstrap(rng.normal(size=(4000, 9)))
    # Of k = 1 direction, one-sided in the square: the score of a squared normal number is normal.
    assert kstest(z, "norm").statistic < 0.04
    assert z.max() > 2.8


def test_shrinkage_steadies_a_score_of_few_episodes():
    rng = np.random.default_rng(5)
    effects = {str(k): [clustered_score(gram_of(rng, 40, False), np.array([0]))] for k in range(12)}
    given = pooled_excess(effects)
    assert given is not None and given.excess == pytest.approx(1.0, abs=0.25) and given.freedom > 4
    few = ClusteredScore(np.array([6.0]), np.array([[1.0], [0.2]]), np.array([0, 1]), (1.0, 1.2), 1.0)
    assert few.z_score() < 1.6
    assert few.z_score(given) > 3.0
    assert pooled_excess({"alone": effects["0"]}) is None


def test_effects_that_follow_the_clock_share_the_prior_of_all_where_nothing_drifts():
    others, quiet, wandering = PooledExcess(1.2, 38.0), PooledExcess(0.9, 6.0), PooledExcess(3.0, 6.0)
    assert pooled_by_kind(others, quiet) == {False: others, True: others}
    assert pooled_by_kind(others, wandering) == {False: others, True: wandering}
    assert pooled_by_kind(None, quiet)[True] is quiet
    few = ClusteredScore(np.array([6.0]), np.ones((4, 1)) / 2, np.arange(4), (1.0, 4.0), 1.0)
    assert few.z_score(others) > few.z_score(quiet) > few.z_score(wandering)


def test_one_that_scatters_far_more_than_its_kind_is_shrunk_little():
    given, own = PooledExcess(1.0, 40.0), np.sqrt(8.0 / 13) * np.ones((13, 1))
    wild = ClusteredScore(np.array([8.0]), own, np.arange(13), (1.0, 12.0), 1.0)
    assert wild.variance == pytest.approx(8.0)
    assert wild.z_score(given) == pytest.approx(wild.z_score(), abs=0.05), "8 of 12 degrees of freedom beside 1 of 40"
    like = ClusteredScore(np.array([8.0]), own / np.sqrt(6), np.arange(13), (1.0, 12.0), 1.0)
    assert like.z_score(given) > like.z_score() + 0.5


def test_an_overestimated_noise_is_no_prior_of_quiet():
    """Most effects scatter as half the noise would; the one that scatters as the noise does is no discovery for it."""
    rng = np.random.default_rng(6)
    alarms, worlds = 0, 400
    for _ in range(worlds):
        quiet = {}
        for k in range(20):
            gram = gram_of(rng, 18, False)
            gram[:, 0, 1] = gram[:, 1, 0] = 0.7 * gram[:, 0, 1]
            quiet[str(k)] = [clustered_score(gram, np.array([0]))]
        alarms += clustered_score(gram_of(rng, 18, False), np.array([0])).z_score(pooled_excess(quiet)) > 2.326
    assert alarms < 1.6 * 0.01 * worlds
