"""Made-up labs: one small data set of theirs, and how verdicts are scored beside it."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

FOLDER = Path(__file__).parents[2] / "benchmarks" / "foreign_labs"


@pytest.fixture(scope="module", autouse=True)
def _bench():
    sys.path.insert(0, str(FOLDER))
    yield
    sys.path.remove(str(FOLDER))
    # Names as short as `path` or `run` may be those of other benchmarks too.
    for name in [n for n, m in sys.modules.items() if str(FOLDER) in str(getattr(m, "__file__", None))]:
        del sys.modules[name]


def test_labs_take_nothing_from_what_they_test():
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [n for n in names if n.split(".")[0] in ("tacdata", "label_farm", "training")], path.name


def test_a_data_set_holds_what_an_import_needs_and_what_is_hidden(tmp_path):
    from labs import LABS

    LABS["d03_compliance_long"].write(tmp_path / "files", "d03_compliance_long")
    mapping = yaml.safe_load((tmp_path / "files" / "mapping.yaml").read_text())
    assert {"version", "name", "sensor", "files", "taxels", "position", "indenter", "contact"} <= set(mapping)
    assert mapping["source"] == "made up"
    log = tmp_path / "files" / mapping["files"]["log"]["path"]
    table = np.genfromtxt(log, delimiter=",", names=True, deletechars="", replace_space=" ")
    assert {"Time (s)", "Position (mm)", "Laser (um)", "Load (N)", "ch0", "ch1", "ch2"} == set(table.dtype.names)
    assert (np.diff(table["Time (s)"]) > 0).all()
    depth = mapping["contact"]["z"] - table["Position (mm)"]
    tip = table["Laser (um)"] / 1e3 - 1
    line = np.polyfit(table["Load (N)"], depth - tip, 1)
    assert line[0] == pytest.approx(0.03, rel=0.02)  # the frame gives way [mm/N]
    assert line[1] == pytest.approx(0.0, abs=1e-3)
    assert all(np.corrcoef(table["Load (N)"], table[f"ch{i}"])[0, 1] > 0.95 for i in range(3))


def test_what_is_hidden_changes_what_is_read():
    import path
    from memory import Friction, Network, Relaxation, SmoothFriction, Softening
    from skin import Skin

    _, depths = path.course(path.cycles((1.0, 2.0), (4.0,), 2, first=0.1))
    _, plain = Skin().pressed(depths)
    hidden = [
        Skin(compliance=0.03),
        Skin(play=0.05),
        Skin(memory=Relaxation(((0.1, 1.0),))),
        Skin(memory=Friction(0.1, 5.0)),
        Skin(memory=SmoothFriction(0.1, 0.25, 1.5)),
        Skin(memory=Network(1.4, 0.175, 0.5, 9)),
        Skin(memory=Softening(2.5, 0.6, 0.1)),
    ]
    for skin in hidden:
        _, loads = skin.pressed(depths)
        assert loads.min() == 0.0
        assert np.abs(loads - plain).max() > 0.01 * plain.max(), skin


def test_every_lab_has_a_truth_that_is_known():
    from labs import LABS

    assert len(LABS) == 30
    assert [lab.number for lab in LABS.values()] == list(range(30))
    effects = FOLDER.parents[1] / "tacdata" / "effects"
    for name, lab in LABS.items():
        assert all((effects / f"{n}.py").exists() for n in (*lab.truth.names, *lab.truth.also)), name
        assert lab.hidden and lab.truth.best


@pytest.mark.parametrize(
    ("names", "status", "members", "expected"),
    [
        (("latency",), "named", [("latency",)], "right"),
        (("latency",), "named", [("latency",), ("drift",)], "wrong"),
        (("latency",), "ambiguous", [("latency", "backlash")], "set with it"),
        (("latency",), "ambiguous", [("latency",), ("backlash", "lost_steps")], "set with it"),
        (("latency",), "ambiguous", [("drift", "gain_drift")], "set without it"),
        (("latency",), "ambiguous", [("drift",), ("latency", "backlash")], "wrong"),
        (("latency",), "unknown", [("latency",)], "unknown, truth suspected"),
        (("latency",), "unknown", [("drift",)], "unknown, other"),
        (("latency",), "none", [], "missed"),
        (("latency", "relaxation"), "named", [("latency",)], "in part"),
        (("latency", "relaxation"), "named", [("latency",), ("relaxation",)], "right"),
        ((), "none", [], "right"),
        ((), "named", [("drift",)], "wrong"),
        ((), "unknown", [], "unknown, other"),
    ],
)
def test_a_verdict_beside_the_truth(names, status, members, expected):
    from truth import Truth, outcome

    statuses = {"unknown": lambda m: "suspected"}.get(status, lambda m: "ambiguous" if m[1:] else "named")
    effects = [{"mechanism": m[0], "alternatives": list(m[1:]), "status": statuses(m)} for m in members]
    assert outcome({"status": status, "effects": effects}, Truth(names)) == expected


def test_what_does_not_show_and_what_has_two_names():
    from truth import Truth, outcome

    none = {"status": "none", "effects": []}
    named = {"status": "named", "effects": [{"mechanism": "relaxation", "alternatives": [], "status": "named"}]}
    assert outcome(none, Truth(("saturation",), shows=False)) == "right"
    assert outcome(named, Truth(("hysteresis",), also=("relaxation",))) == "right"
    assert outcome(named, Truth(("hysteresis",))) == "wrong"
