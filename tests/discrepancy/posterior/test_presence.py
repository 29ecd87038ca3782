"""Presence and estimates: presses that scatter make an effect less sure, and its size less certain."""

from __future__ import annotations

import numpy as np
import pytest

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.bag import sampled
from tacdata.discrepancy.posterior.estimates import estimates
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.presence import presences, scatter
from tacdata.discrepancy.posterior.priors import SetPrior
from tacdata.discrepancy.regressors.tangent import Knob
from tacdata.effects import Placed, load

PRESSES, ROWS = 20, 60
LATE = load("latency")


def sets(sizes: np.ndarray, seed: int = 3) -> tuple[Optimum, Optimum]:
    """Return the empty set and one with a delay, of a size of each press [typical sizes], shape (presses,)."""
    rng = np.random.default_rng(seed)
    noise, column, rest = rng.normal(size=(3, PRESSES, ROWS))
    residual = noise + sizes[:, None] * column
    size = float((residual * column).sum() / np.square(column).sum())
    made = []
    for amount in (None, size):
        placed = () if amount is None else (Placed(LATE, {"L": np.array(amount * LATE.parameters[0].typical)}),)
        left = residual - column * (amount or 0.0)
        every = np.stack([left, *([column] if placed else []), rest], axis=2)
        knobs = tuple(Knob(0, p, None) for p in LATE.parameters) if placed else ()
        rooms = np.array([[-np.inf, np.inf]] * len(knobs)).reshape(-1, 2)
        gram = np.einsum("eri,erj->eij", every, every)
        counts = (len(knobs), 0, 0, 0, 1)
        made.append(
            Optimum(placed, None, knobs, rooms, gram, counts, np.zeros(0), 0.0, np.zeros(PRESSES))  # ty: ignore
        )
    return made[0], made[1]


def probability(sizes: np.ndarray, gain: float) -> float:
    """Return the presence of a delay whose evidence is larger by a gain [nats]."""
    empty, late = sets(sizes)
    return presences([empty, late], np.array([0.0, gain]), 1, SetPrior.of([LATE], POLICY), POLICY)[0]


def test_an_effect_that_scatters_over_presses_is_less_sure():
    """The same evidence is worth less where the size changes its sign from press to press."""
    rng = np.random.default_rng(0)
    steady, restless = np.full(PRESSES, 0.5), 0.1 + 1.5 * rng.normal(size=PRESSES)
    assert scatter(sets(steady)[1], 0, POLICY).ratio < 2.5
    assert scatter(sets(restless)[1], 0, POLICY).ratio > 20
    assert probability(steady, 20.0) > 0.99
    assert probability(restless, 20.0) < 0.5


def test_evidence_of_few_presses_grows_slower_than_that_of_many():
    """With the scale unknown, a size is t-distributed: the logarithm, not the square, of a score counts."""
    own = scatter(sets(np.full(PRESSES, 0.5))[1], 0, POLICY)
    assert own.freedom == PRESSES - 1
    assert own.honest(1.0) == pytest.approx(1.0, rel=0.2 + own.ratio - 1)
    assert own.honest(1000.0) < 60


def test_the_error_of_an_amplitude_is_that_of_least_squares_or_of_the_jackknife():
    """Noise of known size gives the first; a size that differs from press to press the second."""
    for sizes, larger in ((np.full(PRESSES, 0.5), False), (0.5 + np.random.default_rng(1).normal(size=PRESSES), True)):
        empty, late = sets(sizes)
        counts = sampled(empty, POLICY, POLICY.share)
        (found,) = estimates(late, empty, counts, 0.0, POLICY)
        known = LATE.parameters[0].typical / np.sqrt(late.gram[:, 1, 1].sum())
        assert bool(found["L"].error > 2.5 * known) is larger
        low, high = found["L"].interval
        assert low < found["L"].value < high
