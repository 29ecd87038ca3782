"""A thousand seeds of the simulated world; `python tests/simulation/simulated_run.py FIRST LAST` plays others."""

import pytest
from simulated_run import play

BLOCK = 20
"""Seeds of one test [count]: 40 s of a core, so that a busy machine ends it within a test's time limit."""


@pytest.mark.long(
    "tacdata/recording",
    "tacdata/wire",
    "tacdata/devices",
    "tacdata/virtual_rig",
    reason="a thousand recordings with drawn faults, some 25 simulated seconds each",
)
@pytest.mark.parametrize("first", range(0, 1000, BLOCK))
def test_what_must_hold_holds_of_a_thousand_seeds(first):
    failed = {seed: found for seed in range(first, first + BLOCK) if (found := play(seed)[1])}
    assert not failed
