"""How presses that come next are compared with random ones."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

ROOM = Path(__file__).parents[2] / "benchmarks" / "next_presses"
NAMES = ("presses", "run")
PRESS = {
    "x": 0.0,
    "y": 0.0,
    "tool": 0,
    "depth": 0.7,
    "speed": 2.0,
    "hold": 6.0,
    "recovery": 0.0,
    "overshoot": 0.1,
    "purpose": "tells one from another",
}


@pytest.fixture(scope="module")
def bench():
    """Return the benchmark; path and modules are as before when it is done."""
    before = list(sys.path)
    others = {name: sys.modules.pop(name) for name in NAMES if name in sys.modules}  # of other benchmarks
    spec = importlib.util.spec_from_file_location("next_presses_run", ROOM / "run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.path[:] = before
    for name in NAMES:
        sys.modules.pop(name, None)
    sys.modules.update(others)


def told(status, mechanism, level="form"):
    effect = {
        "mechanism": mechanism,
        "status": "named" if status.startswith("named") else status,
        "level": level,
        "family": "delay and filtering",
        "alternatives": [],
    }
    return {"status": status, "effects": [effect]}


def test_random_presses_are_as_long_and_within_what_was_recorded(bench):
    from worlds import protocol

    before = protocol.rich(np.random.default_rng(3), 12)
    drawn = [bench.alike(np.random.default_rng(k), PRESS, before) for k in range(20)]
    assert [bench.length(p) for p in drawn] == pytest.approx([bench.length(PRESS)] * 20)
    assert {(p["x"], p["y"]) for p in drawn} <= {(float(p["x"]), float(p["y"])) for p in before}
    assert max(p["depth"] for p in drawn) <= max(p["depth"] + p["overshoot"] for p in before)
    assert len({round(p["speed"], 3) for p in drawn}) == 20


def test_what_was_recorded_stays_and_presses_come_after_it(bench):
    case = next(c for c in bench.wanted(1000) if c.effects.keys() == {"low_pass_filter"})
    first, more = bench.recordings(case, []), bench.recordings(case, [PRESS, PRESS])
    count = len(first["tool"])
    assert count == bench.EPISODES and len(more["tool"]) == len(more["site"]) == len(more["session"]) == count + 2
    assert np.array_equal(more["readings"][more["episode"] < count], first["readings"])
    assert np.array_equal(more["path"][more["path_episode"] < count], first["path"])
    assert np.all(np.diff(more["time"]) > 0) and more["path"][more["path_episode"] == count][:, 2].max() > 0.75


def test_the_path_has_a_row_at_each_turn_of_a_stroke(bench):
    """Between rows a turn would be cut by more than a lag of a millisecond moves the tip."""
    case = next(c for c in bench.wanted(1000) if c.effects.keys() == {"low_pass_filter"})
    press = {**PRESS, "overshoot": 0.0, "strokes": 5, "stroke": 0.2}
    made = bench.recordings(case, [press])
    own = made["path_episode"] == bench.EPISODES
    time, depth = made["path_time"][own] - made["path_time"][own][0], made["path"][own, 2]
    at, *_, wanted = bench.protocol.breakpoints(sys.modules["presses"].added(press)).T
    np.testing.assert_allclose(np.interp(at[:-1], time, depth), wanted[:-1], atol=1e-9)
    assert np.count_nonzero(np.isclose(wanted, 0.5)) == 2 * press["strokes"]
    assert bench.length(press) > bench.length(PRESS), "random presses take as long"


def test_each_alias_comes_in_two_sizes(bench):
    cases = list(bench.wanted(1000))
    assert len({c.identity for c in cases}) == len(cases)
    sizes = [next(iter(c.effects.values())) for c in cases if c.name.startswith("low_pass_filter-poor")]
    assert max(sizes) == pytest.approx(4 * min(sizes))


@pytest.mark.parametrize(
    ("verdict", "right"),
    [
        (told("named", "low_pass_filter"), True),
        (told("named", "latency"), False),
        (told("named, incomplete", "latency", "family"), None),
        (told("ambiguous", "low_pass_filter"), None),
    ],
)
def test_a_verdict_settles_a_world_by_a_name(bench, verdict, right):
    case = next(c for c in bench.wanted(1000) if c.effects.keys() == {"low_pass_filter"})
    found = bench.settled(case, verdict)
    assert (found and found["right"]) is right


def test_random_presses_go_on_after_recommended_ones_settled(bench, monkeypatch, capsys):
    """Recommended presses settle after four, random ones after twelve."""
    case = next(c for c in bench.wanted(1000) if c.effects.keys() == {"low_pass_filter"})

    def asked(case, more, table, count):
        enough = 4 if count else 12
        return told("named" if len(more) >= enough else "ambiguous", "low_pass_filter"), [PRESS] * 12, 1.0

    monkeypatch.setattr(bench, "asked", asked)
    row = bench.line(case, None)
    assert (row["presses"], row["random_presses"]) == (4, 12)
    assert row["settled"]["right"] and row["random_settled"]["right"]
    bench.score([row])
    assert "at least 3 times fewer: 1 of 1" in capsys.readouterr().out
