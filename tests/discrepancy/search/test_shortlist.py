"""Which effects are refined: what the test found comes along, however many numbers it has."""

from types import SimpleNamespace

import numpy as np
import pytest

from tacdata.discrepancy.search import shortlist as module
from tacdata.effects import load

MANY = "drift"
FEW = ("latency", "tilt", "gain", "xy_offset", "softening", "adhesion", "z_offset", "bulge", "crosstalk", "skew")


@pytest.fixture
def problem(monkeypatch):
    """Ten effects of one number ahead by the BIC of one with 24, which alone explains held-out episodes."""
    names = [*FEW, MANY]
    made = {
        n: SimpleNamespace(effect=load(n), called=load(n).called, columns=np.arange(24 if n == MANY else 1))
        for n in names
    }
    monkeypatch.setattr(module, "best_shapes", lambda problem: made)
    monkeypatch.setattr(module, "_gain", lambda problem, chosen: -3.0 if chosen[0].effect.name == MANY else 1.0)
    monkeypatch.setattr(module, "held_out", lambda problem, chosen: np.full(8, float(chosen[0].effect.name == MANY)))
    monkeypatch.setattr(module, "_pair", lambda problem, first, free: [])
    return SimpleNamespace(candidates=list(made.values()), placed=[], setting=SimpleNamespace(given=[]))


@pytest.mark.parametrize(("p", "tried"), [(0.001, [[MANY]]), (0.2, [])])
def test_what_the_test_found_is_tried(problem, p, tried):
    tests = SimpleNamespace(p=np.array([p if c.effect.name == MANY else 1.0 for c in problem.candidates]), p_generic=1)
    chosen = module.shortlist(problem, tests)
    assert [[c.effect.name for c in one] for one in chosen] == tried
