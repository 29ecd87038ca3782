"""How large errors of several kinds are is told from what readings say of them, all kinds and episodes together."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from tacdata.discrepancy.noise.episode_gls import JointScores
from tacdata.discrepancy.noise.variance_components import components, one_by_one, together

ALIKE = np.linalg.inv(np.array([[0.25, -0.95 * 0.5], [-0.95 * 0.5, 1.0]]))
"""Depth and gain of a press: what tells one is uncertain by what tells the other, at a correlation of -0.95."""


def run_of(errors, rng, information=ALIKE, first=0, shared=False):
    """Return what readings say of episodes' errors; what they share is the response's, where it is fitted."""
    count, kinds = errors.shape
    whole = block_diag(*[information] * count)
    if shared:
        mean = np.kron(np.ones((count, 1)), np.eye(kinds))
        whole = whole - whole @ mean @ np.linalg.solve(mean.T @ whole @ mean, mean.T @ whole)
    values, vectors = np.linalg.eigh(whole)
    noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=count * kinds))
    score = whole @ errors.ravel() + noise
    return JointScores(np.arange(first, first + count), score.reshape(count, kinds), whole)


def sizes_of(told, groups):
    return components(told, groups, 0.05, 10.0).sizes


@pytest.mark.parametrize("sizes", [(0.4, 0.2), (1.5, 0.1), (0.3, 2.0)])
def test_kinds_that_change_readings_almost_alike_are_told_apart(sizes):
    told = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        runs = [run_of(rng.normal(size=(40, 2)) * sizes, rng, first=40 * k) for k in range(10)]
        told.append(sizes_of(runs, [np.repeat(np.arange(10), 40)]))
    assert np.mean(told, axis=0) == pytest.approx(sizes, rel=0.15, abs=0.1)


def test_two_presses_of_a_fitted_place_are_told_from_each_other_alone():
    """The response takes what they share: taken for independent, their difference makes errors 1.4 times as large."""
    told = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        runs = [
            run_of(0.5 * rng.normal(size=(2, 2)), rng, 400 * np.eye(2), 2 * place, shared=True) for place in range(40)
        ]
        told.append(sizes_of(runs, [np.repeat(np.arange(40), 2)]))
    assert np.mean(told, axis=0) == pytest.approx([0.5, 0.5], rel=0.08)


def test_what_a_group_shares_is_no_error_of_an_episode():
    rng = np.random.default_rng(0)
    group = np.arange(120) // 4
    errors = 0.4 * rng.normal(size=(120, 2)) + 5.0 * rng.normal(size=(30, 2))[group]
    runs = [run_of(errors[k : k + 40], rng, 100 * np.eye(2), k) for k in range(0, 120, 40)]
    assert sizes_of(runs, [group]) == pytest.approx([0.4, 0.4], rel=0.25)
    assert sizes_of(runs, [np.zeros(120, dtype=int)]).min() > 3.0


def test_a_few_episodes_unlike_all_others_do_not_decide():
    rng = np.random.default_rng(1)
    errors = 0.5 * rng.normal(size=(60, 2))
    errors[:4] *= 30
    told = [run_of(errors[k : k + 30], rng, 100 * np.eye(2), k) for k in (0, 30)]
    found = components(told, [np.arange(60) // 30], 0.05, 10.0)
    assert found.sizes == pytest.approx([0.5, 0.5], rel=0.45)
    far = np.linalg.norm(found.own, axis=1)
    assert set(np.argsort(far)[-4:]) <= {0, 1, 2, 3}


def test_places_that_are_not_pressed_again_are_compared_with_the_next_ones():
    rng = np.random.default_rng(2)
    drift = np.linspace(0.0, 10.0, 40)[:, None]
    errors = drift + 0.5 * rng.normal(size=(40, 1))
    order = rng.permutation(40)
    (told,) = together(
        one_by_one([JointScores(order, 400 * errors[order] + 20 * rng.normal(size=(40, 1)), 400 * np.eye(40))])
    )
    assert np.array_equal(told.episodes, np.arange(40))
    assert sizes_of([told], [np.arange(40) // 4]) == pytest.approx([0.5], rel=0.3)
    assert sizes_of([told], [np.zeros(40, dtype=int)]) > 2.0
