"""The verb on imported recordings, and on what is not one."""

import json
from itertools import pairwise
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import yaml

from tacdata import documents
from tacdata.discrepancy.data.recordings import _of_one_sensor, _to_the_end
from tacdata.discrepancy.data.strokes import strokes
from tacdata.discrepancy.model.spec import read_spec
from tacdata.discrepancy.run import run
from tacdata.discrepancy.verdict.residual_table import read
from tacdata.errors import FormatError, UsageError
from tacdata.importing.imported_session import import_session
from tacdata.recording import Episode

MAPPING = {
    "version": "1.0",
    "name": "bench",
    "files": {"log": {"path": "press_{trial}.csv", "time": {"column": "t", "unit": "s", "zero": "shared"}}},
    "sensor": {"name": "two pads", "columns": 2, "rows": 1, "pitch_x": 4.0, "pitch_y": 4.0},
    "taxels": {"file": "log", "columns": ["a", "b"], "unit": "pF"},
    "position": {"file": "log", "depth": {"column": "depth", "unit": "mm"}},
    "indenter": {"shape": "sphere", "radius": 3.0},
}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """Twelve presses at two rates whose readings come 80 ms late."""
    folder = tmp_path_factory.mktemp("bench")
    rng = np.random.default_rng(3)
    clock = 0.0
    for k in range(12):
        way = (0.5, 1.5)[k % 2]
        at = np.cumsum([0, 1.0, way, 1.5, way, 1.5])
        time = np.arange(0, at[-1], 0.04)
        depth = np.interp(time, at, [-0.3, -0.3, 1.0, 1.0, -0.3, -0.3])
        late = np.maximum(np.interp(time - 0.08, at, [-0.3, -0.3, 1.0, 1.0, -0.3, -0.3]), 0) ** 1.5
        lines = ["t,depth,a,b"]
        for t, d, s in zip(time, depth, late, strict=True):
            a, b = 100 + 50 * s + 0.1 * rng.normal(), 90 + 20 * s + 0.1 * rng.normal()
            lines.append(f"{clock + t:.4f},{d:.5f},{a:.4f},{b:.4f}")
        (folder / f"press_{k:02d}.csv").write_text("\n".join(lines))
        clock += at[-1] + 2
    (folder / "mapping.yaml").write_text(yaml.safe_dump(MAPPING))
    return import_session(folder, folder / "mapping.yaml", folder / "session").folder


def test_imported_recordings_are_judged_into_a_folder(session, tmp_path):
    said: list[str] = []
    written = run([session], read_spec(None), tmp_path / "verdict", said.append)
    answer = documents.read(tmp_path / "verdict" / "verdict.json", "verdict")
    assert any(words.startswith("there is a gap, p = 0.0") for words in said)
    assert any(words.startswith("so far: ") for words in said), "what was found is said on the way"
    assert answer["status"] in (tmp_path / "verdict" / "verdict.html").read_text()
    assert answer["data"]["episodes"] == 12
    assert answer["status"] in ("named", "ambiguous")
    assert any("latency" in (e["mechanism"], *e["alternatives"]) for e in answer["effects"])
    assert (tmp_path / "verdict" / "verdict.png").stat().st_size > 10_000
    assert written.text.startswith(answer["status"].upper())
    told = read(tmp_path / "verdict" / "residuals.parquet")
    assert told.streams == ("channel 0", "channel 1") and told.measured.shape == (answer["data"]["rows"], 2)
    left = [float(np.mean(np.square(told.standardized(predicted)))) for predicted in (told.before, told.after)]
    assert left[1] < 0.1 * left[0] and left[1] < 3, "what is left is about the noise"
    slices = {(s["by"], s["name"]): s for s in answer["slices"]}
    assert slices["phase", "loading"]["before"] > 10 * slices["phase", "loading"]["after"]
    if answer["status"] == "named":
        following = documents.read(tmp_path / "verdict" / "spec.json", "model_spec")
        assert following["parent"] == read_spec(None).content_hash
        # One delay, or one either way: the planted one.
        assert list(following["effects"][-1]["values"].values()) == pytest.approx([0.08], abs=0.01) or list(
            following["effects"][-1]["values"].values()
        ) == pytest.approx([0.08, 0.08], abs=0.01)


@pytest.mark.parametrize(("step", "last"), [("eliminate", "fit"), ("race", "locate")])
def test_an_interrupt_keeps_the_verdict_so_far(session, tmp_path, monkeypatch, step, last):
    def interrupt(*args):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"tacdata.discrepancy.search.find.{step}", interrupt)
    with pytest.raises(KeyboardInterrupt) as raised:
        run([session], read_spec(None), tmp_path / "verdict")
    assert raised.value.__notes__[0].startswith(f"  kept: {tmp_path / 'verdict'}: stopped after {last}: a gap")
    written = documents.read(tmp_path / "verdict" / "verdict.json", "verdict")
    assert written["status"] == "unknown" and bool(written["effects"]) == (last == "fit")


def test_nothing_is_overwritten_and_bad_input_is_answered_in_words(session, tmp_path):
    with pytest.raises(UsageError, match="exists"):
        run([session], read_spec(None), tmp_path)
    with pytest.raises(UsageError, match="nothing"):
        run([tmp_path / "nothing"], read_spec(None), tmp_path / "new")
    (tmp_path / "spec.json").write_text(json.dumps({"version": "1.0", "name": "x"}))
    with pytest.raises(FormatError, match="response"):
        read_spec(tmp_path / "spec.json")
    spec = {
        "version": "1.0",
        "name": "x",
        "response": {"kind": "fitted"},
        "effects": [{"effect": "latency", "values": {"late": 1.0}}],
    }
    (tmp_path / "spec.json").write_text(json.dumps(spec))
    with pytest.raises(FormatError, match="latency"):
        run([session], read_spec(tmp_path / "spec.json"), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_recording_of_many_strokes_is_cut_between_them():
    time = np.arange(0, 40, 0.1)
    depth = 1 - np.cos(2 * np.pi * time / 10)
    spans = strokes((time * 1e9).astype(np.int64), depth)
    assert len(spans) == 4
    edges = np.array([s[0] for s in spans[1:]]) / 1e9
    np.testing.assert_allclose(edges, [10, 20, 30], atol=0.11)
    assert all(a[1] == b[0] for a, b in pairwise(spans))


def test_strokes_of_an_axis_that_points_the_other_way_are_the_same():
    time_ns = np.arange(0, 40_000, 100) * 1_000_000
    depth = 1 - np.cos(2 * np.pi * time_ns / 1e10)
    assert strokes(time_ns, 2 - depth) == strokes(time_ns, depth)
    one = slice(0, 101)
    assert len(strokes(time_ns[one], 2 - depth[one])) == 1


def test_what_is_read_after_the_tip_came_to_rest_counts_where_it_is_off_the_skin():
    """A recovery is read long after the guide's last motion; where the tip rests in the skin, nobody knows how long."""
    time_ns = np.arange(0, 20_000, 100) * 1_000_000
    span = [(2_000_000_000, 5_000_000_001)]
    away, inside = np.array([-2.0, 1.0, -2.0]), np.array([-2.0, 0.5, 1.0])
    assert _to_the_end(span, away, time_ns) == [(0, 19_900_000_001)]
    assert _to_the_end(span, inside, time_ns) == [(0, 5_000_000_001)]


def test_recordings_of_several_sensors_are_told_of_or_refused():
    def worn(name, pitch=4.0):
        taxels = SimpleNamespace(columns=2, rows=1, pitch_x=pitch, pitch_y=4.0)
        return cast(Episode, SimpleNamespace(sensor=SimpleNamespace(name=name, taxels=taxels)))

    assert _of_one_sensor([worn("a"), worn("a")]) == []
    [words] = _of_one_sensor([worn("monday"), worn("tuesday")])
    assert "monday, tuesday" in words
    with pytest.raises(FormatError, match="several kinds"):
        _of_one_sensor([worn("a"), worn("b", pitch=2.0)])
