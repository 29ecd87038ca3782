"""A few hidden worlds, made by code that shares nothing with the library; the benchmark proper is benchmarks/."""

import sys
from pathlib import Path

import numpy as np
import pytest

from tacdata.chain.table_response import TableResponse

FOLDER = Path(__file__).parents[2] / "benchmarks" / "hidden_worlds"


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """Return a function that judges a world: effects, seed, response."""
    sys.path.insert(0, str(FOLDER))
    try:
        import run
        import skin
        import world
    finally:
        sys.path.remove(str(FOLDER))
    path = tmp_path_factory.mktemp("table") / "table.npz"
    skin.write_table(path, world.RADII)
    table = TableResponse.read(path)
    return lambda effects, seed, response, **settings: run.answer(
        world.make(seed, effects, **settings), response, table
    )


def test_the_generator_takes_nothing_from_what_it_tests():
    for name in ("skin", "protocol", "physics", "world", "cases"):
        assert "tacdata" not in (FOLDER / f"{name}.py").read_text().replace("shared with tacdata", "")


@pytest.mark.slow
@pytest.mark.parametrize("seed", [21, 22])
def test_nothing_hidden_gives_no_name(answer, seed):
    assert answer({}, seed, "table")["status"] != "named"
    assert answer({}, seed, "fitted")["status"] != "named"


@pytest.mark.slow
def test_a_hidden_delay_is_found_and_measured(answer):
    given = answer({"latency": 1.0}, 23, "table")
    assert "latency" in {name for m in given["members"] for name in (m["mechanism"], *m["rivals"])}
    assert np.isclose(given["members"][0]["values"].get("L", 0.04), 0.04, atol=0.01)


@pytest.mark.slow
def test_a_common_gain_is_never_named_without_a_force(answer):
    given = answer({"gain": 2.0}, 24, "table")
    assert given["status"] != "named"
    assert any("modulus" in (m["mechanism"], *m["rivals"]) for m in given["members"])
