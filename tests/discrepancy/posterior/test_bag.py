"""Samples of presses: noise makes no remainder, one press gives no name, and the empty set keeps its own noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.bag import bagged
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.regressors.tangent import Knob
from tacdata.effects import Placed, load

PRESSES, ROWS, HISTORIES = 24, 60, 60


def model_of(residual: np.ndarray, column: np.ndarray, rest: np.ndarray, amount: float | None) -> Optimum:
    """Return the empty set, or one with a delay at its optimum, beside a remainder's columns."""
    effect = load("latency")
    placed = () if amount is None else (Placed(effect, {"L": np.array(amount)}),)
    left = residual if amount is None else residual - column * amount / effect.parameters[0].typical
    parts = [left[:, :, None], *([column[:, :, None]] if placed else []), rest]
    every = np.concatenate(parts, axis=2)
    knobs = tuple(Knob(0, p, None) for p in effect.parameters) if placed else ()
    rooms = np.array([k.room(placed) for k in knobs]).reshape(-1, 2)
    gram = np.einsum("eri,erj->eij", every, every)
    counts = (len(knobs), 0, 0, 0, rest.shape[2])
    return Optimum(placed, None, knobs, rooms, gram, counts, np.zeros(0), 0.0, np.zeros(PRESSES))  # ty: ignore


def posterior_of(seed: int, signal: np.ndarray, share: float):
    """Return the posterior of nothing and a delay, given a signal of each press, shape (presses,)."""
    rng = np.random.default_rng(seed)
    residual, column = rng.normal(size=(2, PRESSES, ROWS))
    rest = rng.normal(size=(PRESSES, ROWS, HISTORIES))
    residual = residual + signal[:, None] * column
    amount = float((residual * column).sum() / np.square(column).sum()) * load("latency").parameters[0].typical
    models = [model_of(residual, column, rest, None), model_of(residual, column, rest, amount)]
    return bagged(models, SetPrior.of([load("latency")], POLICY), replace(POLICY, share=share, bags=40))


def test_noise_alone_makes_no_remainder_probable():
    """A bootstrap repeats presses: among many columns noise alone then looks like a remainder."""
    nothing = np.zeros(PRESSES)
    apart = [posterior_of(seed, nothing, POLICY.share).remainder for seed in range(6)]
    repeated = [posterior_of(seed, nothing, 1.0).remainder for seed in range(6)]
    assert max(apart) < 0.5
    assert np.mean(repeated) > 1.5 * np.mean(apart)


def test_an_effect_of_all_presses_is_named_and_one_of_a_single_press_is_not():
    """The sample that leaves the press out has no such effect."""
    every, alone = np.full(PRESSES, 0.3), np.zeros(PRESSES)
    alone[5] = 2.5
    assert posterior_of(3, every, POLICY.share).mechanisms["latency"] > 0.99
    assert posterior_of(3, alone, POLICY.share).mechanisms.get("latency", 0.0) < POLICY.named


def test_the_empty_set_keeps_the_probability_that_it_has_beside_its_own_noise():
    """Noise that was estimated given effects is smaller, and beside it the empty set loses unfairly."""
    first, later = (posterior_of(3, np.full(PRESSES, size), POLICY.share) for size in (0.0, 0.3))
    joined = later.with_empty(first)
    assert joined.empty == first.empty > later.empty
    assert np.isclose(joined.weights.sum(), 1.0)
    assert later.with_empty(later) is later
