"""Each safeguard is taken out in turn: what must hold of every run has to notice that it is missing."""

import pytest
from mutants import KINDS, MUTANTS, without
from simulated_run import play

ROOMS = ("tacdata/recording", "tacdata/wire", "tacdata/devices", "tests/simulation")


def noticed(name, seeds, kinds=()):
    """The first seed in which something does not hold without a safeguard; None if there is none."""
    with without(name):
        return next((seed for seed in seeds if play(seed, kinds)[1]), None)


def test_every_mutant_names_its_faults():
    assert set(KINDS) == set(MUTANTS)


@pytest.mark.long(*ROOMS, reason="some recordings with each of 15 safeguards missing")
@pytest.mark.parametrize("name", MUTANTS)
def test_a_missing_safeguard_is_noticed_by_its_own_faults(name):
    assert noticed(name, range(25), KINDS[name]) is not None


@pytest.mark.long(*ROOMS, reason="up to a thousand recordings with each of 15 safeguards missing")
@pytest.mark.parametrize("name", MUTANTS)
def test_a_thousand_seeds_notice_each_missing_safeguard(name):
    assert noticed(name, range(1000)) is not None
