"""Files as labs keep them come in by the proposal alone, or it asks."""

import importlib.util
import os
import sys
from pathlib import Path

import numpy as np
import pytest

ROOM = Path(__file__).parents[2] / "benchmarks" / "files_as_kept"
ASKED = {"capacitance"}
"""An array without names: a person says what its columns are."""
RECORDINGS = {
    "strips": 27,
    "foam": 10,
    "capacitance": 24,
    "fluidic": 20,
    "barometric": 24,
    "magnetic": 36,
    "piston": 18,
    "gel": 24,
    "frame": 18,
    "clean": 24,
}


@pytest.fixture(scope="module")
def bench():
    """Return the benchmark's script; path, modules and environment are as before when it is done."""
    path, environment, modules = list(sys.path), dict(os.environ), set(sys.modules)
    sys.path.insert(0, str(ROOM))
    spec = importlib.util.spec_from_file_location("files_as_kept_run", ROOM / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = path
    os.environ.clear()
    os.environ.update(environment)
    for name in {"sets", "laws"} & (set(sys.modules) - modules):
        del sys.modules[name]


@pytest.mark.parametrize("name", RECORDINGS)
def test_each_set_comes_in_whole(bench, tmp_path, name):
    kept = bench.SETS[name](tmp_path, np.random.default_rng(7))
    made = bench.imported(tmp_path, kept)
    assert made["as_proposed"] == (name not in ASKED)
    assert (made["recordings"], made["refused"]) == (RECORDINGS[name], 0)


def row(mechanism, family, status, level="form", alternatives=()):
    effect = {"mechanism": mechanism, "family": family, "status": status, "level": level}
    return {
        "mechanisms": ["adhesion"],
        "families": ["contact"],
        "verdict": {"effects": [{**effect, "alternatives": list(alternatives)}]},
    }


@pytest.mark.parametrize(
    ("given", "right"),
    [
        (row("adhesion", "contact", "named"), {"family", "mechanism", "suspected"}),
        (row("hysteresis", "friction and play", "named"), {"wrong"}),
        (row("hysteresis", "friction and play", "ambiguous", None, ["adhesion"]), {"mechanism", "suspected"}),
        (row("adhesion", "contact", "suspected", None), {"suspected"}),
    ],
)
def test_a_name_is_right_only_where_it_is_there(bench, given, right):
    assert {name for name, true in bench.outcome(given).items() if true} == right
