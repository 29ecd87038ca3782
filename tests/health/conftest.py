"""One unit's visits, recorded once."""

import pytest
from unit_examples import SEED, record

from tacdata.health.visit import read_visit


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """The folder of two healthy visits, monday and tuesday."""
    made = tmp_path_factory.mktemp("unit")
    for visit, name in enumerate(("monday", "tuesday")):
        record(made / name, SEED, visit)
    return made


@pytest.fixture(scope="session")
def monday(folder):
    return read_visit(folder / "monday")


@pytest.fixture(scope="session")
def tuesday(folder):
    return read_visit(folder / "tuesday")
