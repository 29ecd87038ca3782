"""Which of two models the episodes bear out: made-up residuals with a known difference."""

from types import SimpleNamespace

import numpy as np
import pytest
from pressing import course

from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.noise.readings import spread_of
from tacdata.discrepancy.search.j_test import ModelError, j_statistic
from tacdata.effects import load

EPISODES, ROWS = 48, 40


class Nothing:
    """Candidates that lend nothing."""

    def get(self, kind):
        return None


UNSHAKEN = np.zeros((EPISODES * ROWS, 1, 2))


def model(left, *names):
    episode = np.repeat(np.arange(EPISODES), ROWS)
    energy = 0.5 * np.bincount(episode, np.square(left).sum(axis=1))
    placed = tuple(SimpleNamespace(effect=load(name)) for name in names)
    return SimpleNamespace(
        left=left,
        episode=episode,
        energy=energy,
        placed=placed,
        loss=energy.sum(),
        freedom=0.0,
        projected_draws=UNSHAKEN,
        knobs=[],
        place=episode // 4,
    )


def signal(size, episodes, rng):
    """A signature of a given length [standard deviations], in some episodes alone."""
    made = rng.normal(size=(EPISODES * ROWS, 1)) * np.isin(np.repeat(np.arange(EPISODES), ROWS), episodes)[:, None]
    return size * made / np.linalg.norm(made)


@pytest.mark.parametrize("count", [5, 48])
def test_few_presses_bear_an_effect_out_as_well_as_all(count):
    """A mean over episodes of the gain cannot reach 2.4 standard errors with 5 of 48 presses; this does."""
    told = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noise, true = rng.normal(size=(EPISODES * ROWS, 1)), signal(9.0, np.linspace(0, 47, count, dtype=int), rng)
        told.append(j_statistic(model(noise, "relaxation"), model(noise + true), Nothing()))
    assert np.median(told) == pytest.approx(6.0 if count == 48 else 3.3, abs=1.2)
    assert np.quantile(told, 0.1) > 2.4
    assert min(told) >= 0


def test_without_a_difference_nothing_is_borne_out():
    told = []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        noise, wrong = rng.normal(size=(EPISODES * ROWS, 1)), signal(3.0, np.arange(48), rng)
        told.append(j_statistic(model(noise - wrong, "relaxation"), model(noise), Nothing()))
    # The first is wrong: only chance can bear it out, and seldom far.
    assert np.mean(np.array(told) > 2.33) < 0.02
    assert j_statistic(model(noise), model(noise), Nothing()) == 0.0


def test_order_only_changes_the_sign():
    rng = np.random.default_rng(1)
    noise, true = rng.normal(size=(EPISODES * ROWS, 1)), signal(6.0, np.arange(20), rng)
    first, second = model(noise, "creep"), model(noise + true, "drift")
    assert j_statistic(first, second, Nothing()) == -j_statistic(second, first, Nothing())


@pytest.mark.parametrize("spread", [0.0, 0.003, 0.03])
def test_a_spread_is_told_from_those_that_know_it(spread):
    """Most differences are hardly known; the few that are must not drown among them."""
    told = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        known = np.exp(rng.normal(-8, 2.5, 400))
        told.append(spread_of(rng.normal(size=400) * np.sqrt(2 * spread**2 + known), known))
    assert np.median(told) == pytest.approx(spread, abs=max(0.1 * spread, 3e-4))
    assert np.quantile(told, 0.95) < 1.3 * spread + 2e-3


def test_what_an_equation_may_be_off_about_is_nothing_against_it():
    rng = np.random.default_rng(4)
    noise, true = rng.normal(size=(EPISODES * ROWS, 1)), signal(9.0, np.arange(48), rng)
    first, second = model(noise, "relaxation"), model(noise + true, "creep")
    course = SimpleNamespace(episode=first.episode, episodes=EPISODES)
    nothing = SimpleNamespace(
        nuisances=np.zeros((len(noise), 1, 0)), inner=np.zeros((EPISODES, 0, 0)), ridge=np.zeros(0)
    )

    def against(column):
        return j_statistic(first, second, Nothing(), ModelError(column[:, :, None], course, nothing))

    bare = j_statistic(first, second, Nothing())
    assert bare > 4.5
    assert against(signal(30.0, np.arange(48), rng)) == pytest.approx(bare, abs=0.4), "off about another thing"
    assert against(3 * true) < 1.0, "it may be off by three times what it is"
    assert 0.3 * bare < against(0.1 * true) < 0.95 * bare, "it may be off by a tenth of what it is"


def test_what_both_models_miss_is_nothing_to_either():
    """An episode unlike all others, along what the second's equation may be off about, is missed by both."""
    rng = np.random.default_rng(6)
    noise, true = rng.normal(size=(EPISODES * ROWS, 1)), signal(6.0, np.delete(np.arange(48), 11), rng)
    odd = signal(40.0, np.array([11]), rng)
    first, second = model(noise + odd, "relaxation"), model(noise + odd + true, "creep")
    course = SimpleNamespace(episode=first.episode, episodes=EPISODES)
    nothing = SimpleNamespace(
        nuisances=np.zeros((len(noise), 1, 0)), inner=np.zeros((EPISODES, 0, 0)), ridge=np.zeros(0)
    )
    error = ModelError(odd[:, :, None] + signal(2.0, np.arange(48), rng)[:, :, None], course, nothing)
    assert j_statistic(first, second, Nothing(), error) > 0.8 * j_statistic(first, second, Nothing()) > 1.5


@pytest.mark.parametrize("turned", [1.0, 0.3])
def test_responses_that_follow_noise_differently_are_level(turned):
    """Two models that lack nothing, whose responses take up other functions, and one of them more of them.

    Every place of four presses has its own: they have nothing in common beside ten, or are those of the other turned.
    """
    rows, places, freer = EPISODES * ROWS, EPISODES // 4, 5
    rng, each = np.random.default_rng(7), EPISODES * ROWS // (EPISODES // 4)
    bases = []
    for _ in range(places):
        common, own = rng.normal(size=(each, 10)), rng.normal(size=(each, 4))
        other = np.hstack([own + turned * rng.normal(size=own.shape), rng.normal(size=(each, freer))])
        pair = [np.linalg.qr(np.hstack([common, more]))[0] for more in (own, other)]
        bases.append(pair)
    draws, told = rng.normal(size=(rows, 2)), []

    def without(values, which):
        parts = np.split(values, places)
        return np.concatenate([p - b[which] @ (b[which].T @ p) for p, b in zip(parts, bases, strict=True)])

    def fitted_by(which, values, name):
        made = model(without(values, which), name)
        made.projected_draws = without(draws, which)[:, None, :]
        made.whitener = SimpleNamespace(projected=lambda values: without(values[:, 0], which)[:, None])
        made.freedom = float(sum(pair[which].shape[1] for pair in bases))
        made.loss = made.energy.sum() + 0.5 * made.freedom
        return made

    for _ in range(300):
        noise = rng.normal(size=(rows, 1))
        told.append(j_statistic(fitted_by(0, noise, "backlash"), fitted_by(1, noise, "creep"), Nothing()))
    assert abs(np.mean(told)) < 0.25, "neither is ahead on average"
    assert np.mean(np.abs(told) > 2.33) < 0.05
    assert np.std(told) > 0.5, "they are compared, though"


def test_what_the_worse_response_may_take_up_is_no_evidence_of_single_presses():
    """Presses err by gains of their own, of which a place's mean is taken up: in four of them together they cancel.

    The better model's response took up a little more of the same at every place. (Before, that was part of how both
    differ, and pulled at every press by itself: 4 standard errors were 1.5.)
    """
    told = []
    shape = np.sin(np.arange(ROWS) * np.pi / ROWS)[:, None] / np.sqrt(ROWS / 2)

    def without(values):
        parts = values.reshape(EPISODES // 4, 4 * ROWS, -1)
        base = np.tile(shape, (4, 1)) / 2
        return (parts - base @ (base.T @ parts)).reshape(EPISODES * ROWS, 1, -1)

    for seed in range(20):
        rng = np.random.default_rng(seed)
        aside, gains = signal(5.0, np.arange(48), rng), 5.0 * rng.normal(size=(EPISODES, 1, 1))
        read = without((gains * shape + rng.normal(size=(EPISODES, ROWS, 1))).reshape(-1, 1))[:, :, 0]
        more = np.repeat(0.4 * rng.normal(size=(EPISODES // 4, 1, 1)), 4, axis=0) * shape
        first, second = model(read + more.reshape(-1, 1), "temperature_stiffness"), model(read + aside, "creep")
        first.projected_draws = UNSHAKEN + 0.0
        first.whitener = second.whitener = SimpleNamespace(projected=without)
        told.append(j_statistic(first, second, Nothing()))
    assert np.median(told) == pytest.approx(4.0, abs=0.6)


def test_numbers_of_its_own_do_not_bring_a_model_ahead():
    """A model lacks nothing; another has 24 amplitudes more (drift of every channel), fitted to noise."""
    rows, told = EPISODES * ROWS, []
    rng = np.random.default_rng(5)
    knobs = [SimpleNamespace(at=1, shape=False) for _ in range(24)]
    basis = np.linalg.qr(rng.normal(size=(rows, 24)))[0]
    for _ in range(200):
        noise = rng.normal(size=(rows, 1))
        richer = model(noise - basis @ (basis.T @ noise), "relaxation", "drift")
        richer.knobs = knobs
        told.append(j_statistic(richer, model(noise, "relaxation"), Nothing()))
    assert np.mean(np.array(told) > 2.33) < 0.03, "by 3.5 on average if they are not counted"
    assert abs(np.mean(told)) < 0.7


def test_an_equation_is_off_by_a_few_standard_deviations_and_not_by_a_hundred():
    """However many readings there are: a scale was taken for a frame that gives way, 46,000 nats for 680,000."""
    made = course(episodes=12)
    null = null_model(Setting(made, FittedResponse(made), []))
    column = np.random.default_rng(0).normal(size=(made.reduced.rows, made.channels, 1)).astype(np.float32)
    error = ModelError(column, made.reduced, null)
    for times, most in ((1.0, 1.0), (100.0, 0.1)):
        left = times * column[:, :, 0]
        _, fallen = error.beside(left, left)
        assert fallen <= most * 0.5 * float(np.square(left).sum())
    assert error.beside(column[:, :, 0], column[:, :, 0])[1] > 0.4 * float(np.square(column).sum())
