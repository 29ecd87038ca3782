"""Each safeguard is taken out in turn: what must hold of every run has to notice that it is missing."""

import pytest
from mutants import KINDS, MUTANTS, noticed


def test_every_mutant_names_its_faults():
    assert set(KINDS) == set(MUTANTS)


@pytest.mark.long(
    "tacdata/recording",
    "tacdata/wire",
    "tacdata/devices",
    "tests/simulation",
    reason="some recordings with each of 15 safeguards missing",
)
@pytest.mark.parametrize("name", MUTANTS)
def test_a_missing_safeguard_is_noticed_by_its_own_faults(name):
    # A motion without a mark is noticed in 8 of 100 seeds, the others in the first 25: a kill must fall into a motion.
    assert noticed(name, range(100), KINDS[name]) is not None
