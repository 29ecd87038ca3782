"""The evidence of a set: exact where everything is linear and normal; bounds; the remainder's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from tacdata.discrepancy.evidence.optimum import Optimum
from tacdata.discrepancy.posterior.laplace import largest_information, log_evidence
from tacdata.discrepancy.posterior.policy import POLICY
from tacdata.discrepancy.posterior.priors import NumberPrior
from tacdata.discrepancy.regressors.tangent import Knob
from tacdata.effects import Placed, load

PRESSES, ROWS = 8, 50


def model_of(columns: np.ndarray, residual: np.ndarray, counts: tuple[int, int, int, int, int], amount: float):
    """Return a set with one amplitude, or none, on columns of a kind each, shape (presses, rows, k)."""
    effect = load("latency")
    placed = (Placed(effect, {"L": np.array(amount)}),) if counts[0] else ()
    every = np.concatenate([residual[:, :, None], columns], axis=2)
    knobs = tuple(Knob(0, p, None) for p in effect.parameters)[: counts[0]]
    rooms = np.array([k.room(placed) for k in knobs]).reshape(-1, 2)
    gram = np.einsum("eri,erj->eij", every, every)
    return Optimum(placed, None, knobs, rooms, gram, counts, np.ones(counts[3]), 0.0, np.zeros(PRESSES))  # ty: ignore


def test_the_evidence_of_nuisances_and_a_remainder_is_that_of_a_normal_distribution():
    """Integrated out in closed form, the evidence is the density of a normal distribution with that covariance."""
    rng = np.random.default_rng(3)
    columns, residual = rng.normal(size=(PRESSES, ROWS, 4)), rng.normal(size=(PRESSES, ROWS))
    model = model_of(columns, residual, (0, 0, 0, 2, 2), 0.0)
    policy = replace(POLICY, sizes=(0.0, 3.0), quiet=0.5)
    largest = largest_information(model)
    found = log_evidence(model, np.ones((1, PRESSES)), largest, policy)[0]
    flat, values = columns.reshape(-1, 4), residual.ravel()
    for size, evidence in zip(policy.sizes, found, strict=True):
        prior = np.diag([1.0, 1.0, size**2 / largest, size**2 / largest])
        covariance = np.eye(len(values)) + flat @ prior @ flat.T
        expected = -0.5 * values @ np.linalg.solve(covariance, values) - 0.5 * np.linalg.slogdet(covariance)[1]
        assert evidence == pytest.approx(expected + np.log(0.5), abs=2e-3)


def test_an_amplitude_is_integrated_out_about_its_optimum():
    """Near the optimum a t prior is normal with its own curvature; the integral agrees with a sum on a grid."""
    rng = np.random.default_rng(5)
    column = rng.normal(size=(PRESSES, ROWS, 1))
    residual = rng.normal(size=(PRESSES, ROWS))
    amount = load("latency").parameters[0].typical
    model = model_of(np.concatenate([column, np.zeros((PRESSES, ROWS, 1))], axis=2), residual, (1, 0, 0, 0, 1), amount)
    policy = replace(POLICY, sizes=(0.0,), quiet=1.0)
    found = log_evidence(model, np.ones((1, PRESSES)), 1.0, policy)[0, 0]
    grid = np.linspace(-1, 1, 20001)
    square = np.square(residual[:, :, None] - column * grid).sum(axis=(0, 1))
    logs = [
        NumberPrior.of(model.knobs, (Placed(load("latency"), {"L": np.array(amount * (1 + d))}),), policy).log
        for d in grid[::100]
    ]
    values = -0.5 * square[::100] + np.array(logs)
    expected = np.log(np.trapezoid(np.exp(values - values.max()), grid[::100])) + values.max() - 0.5 * np.log(2 * np.pi)
    assert found == pytest.approx(expected, abs=0.05)


def test_an_amplitude_does_not_leave_its_bounds_in_a_sample():
    """Where presses that are drawn ask for a size beyond a bound, that is worth no more than the bound."""
    rng = np.random.default_rng(7)
    column = rng.normal(size=(PRESSES, ROWS, 1))
    low = load("latency").parameters[0].low
    inside = model_of(np.concatenate([column, 0 * column], axis=2), -0.1 * column[:, :, 0], (1, 0, 0, 0, 1), low)
    policy = replace(POLICY, sizes=(0.0,), quiet=1.0)
    found = log_evidence(inside, np.ones((1, PRESSES)), 1.0, policy)[0, 0]
    square = float(inside.gram[:, 0, 0].sum())
    prior = NumberPrior.of(inside.knobs, inside.placed, policy).log
    assert found < -0.5 * square + prior


@pytest.mark.parametrize("by", [0.0, 0.2, -0.3])
def test_only_the_mass_inside_bounds_counts(by):
    """A bound near the optimum, inside or beyond, leaves the integral over one side of it."""
    rng = np.random.default_rng(9)
    column, residual = rng.normal(size=(PRESSES, ROWS, 1)), rng.normal(size=(PRESSES, ROWS))
    amount = load("latency").parameters[0].typical
    wide = model_of(np.concatenate([column, 0 * column], axis=2), residual, (1, 0, 0, 0, 1), amount)
    policy = replace(POLICY, sizes=(0.0,), quiet=1.0)
    prior = NumberPrior.of(wide.knobs, wide.placed, policy)
    precision = float(wide.gram[:, 1, 1].sum() + prior.precision[0])
    best = float(wide.gram[:, 1, 0].sum() + prior.slope[0]) / precision
    spread = precision**-0.5
    narrow = replace(wide, rooms=np.array([[best + by * spread, np.inf]]))
    wide = replace(wide, rooms=np.array([[-np.inf, np.inf]]))
    ones = np.ones((1, PRESSES))
    share = log_evidence(narrow, ones, 1.0, policy)[0, 0] - log_evidence(wide, ones, 1.0, policy)[0, 0]
    assert share == pytest.approx(np.log(norm.sf(by)), abs=1e-3)
