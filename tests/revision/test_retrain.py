"""Networks before and after: what a revision does to labels, or to readings that a model says, shows in scores."""

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from revised_bench import MAPPING, verdict

sys.path.insert(0, str(Path(__file__).parents[1] / "label_farm"))
from farm_examples import HERE

from tacdata.discrepancy.model.spec import read_spec
from tacdata.errors import UsageError
from tacdata.importing.imported_session import import_session
from tacdata.label_farm.labelling import FarmSettings, Labelling
from tacdata.label_farm.store.store import Store
from tacdata.recording import read_episode, read_session
from tacdata.revision.labels.retrain import Recipe
from tacdata.revision.revise import RevisionOptions, revise
from tacdata.sensor import default_sensor

SETTINGS = FarmSettings(factory="fast_model:FastModel", workers=1)


def recorded(folder, late, episodes=7):
    """Import presses of the default sensor whose readings come late [s], labelled by the farm's fast model."""
    folder.mkdir(parents=True)
    sensor, rng, clock = default_sensor(), np.random.default_rng(3), 0.0
    names = [f"c{k}" for k in range(sensor.taxels.count)]
    for k in range(episodes):
        x, way = rng.uniform(-3, 3), 0.6
        at = np.cumsum([0, 1.0, way, 1.0, way, 1.0])
        path = [-0.3, -0.3, 1.0, 1.0, -0.3, -0.3]
        time = np.arange(0, at[-1], 0.08)
        near = np.exp(-np.square(sensor.taxels.centers - (x, 0.0)).sum(axis=1) / 4.0)
        load = np.maximum(np.interp(time - late, at, path), 0)[:, None] * near
        values = np.column_stack([clock + time, np.full(len(time), x), np.interp(time, at, path), 1e4 + 3e3 * load])
        values[:, 3:] += rng.normal(size=load.shape)
        np.savetxt(
            folder / f"press_{k:02d}.csv",
            values,
            delimiter=",",
            header=",".join(["t", "x", "d", *names]),
            comments="",
            fmt="%.5f",
        )
        clock += at[-1] + 2
    (folder / "sensor.yaml").write_text(yaml.safe_dump(sensor.document))
    position = {"file": "log", "x": {"column": "x", "unit": "mm"}, "depth": {"column": "d", "unit": "mm"}}
    taxels = {"file": "log", "columns": names, "unit": "counts"}
    mapping = {**MAPPING, "sensor": "sensor.yaml", "taxels": taxels, "position": position}
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    session = import_session(folder, folder / "mapping.yaml", folder / "session").folder
    recordings = {e.number: (lambda e=e: e) for e in map(read_episode, read_session(session).episodes)}
    summary = Labelling(session / "labels", Store(session / "labels" / "store"), SETTINGS).run(recordings)
    assert not summary.failed, summary.failed
    return session


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Readings 0.3 s late; the labels know nothing of it. Revised with the delay, networks trained on either."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(HERE))
        folder = tmp_path_factory.mktemp("retrained")
        session = recorded(folder / "bench", 0.3)
        judged = verdict(folder / "verdict", "latency", {"L": 0.3})
        wishes = RevisionOptions(SETTINGS, retrain=Recipe(epochs=4, network="direct", threads=1))
        yield revise(judged, [session], read_spec(None), folder / "revision", wishes)


def test_a_network_learns_better_from_labels_that_are_paired_rightly(both):
    told = both.document["retrained"]
    assert told["by"] == "labels" and told["frames"] > 20 and told["episodes"] >= 1
    metrics = {m["name"]: m for m in told["metrics"]}
    assert metrics["pixel_rmse"]["after"] < metrics["pixel_rmse"]["before"]
    moved = both.document["labels"][0]
    assert moved["solved"] == 0 and moved["found"] == 7, "late labels are the same presses"
    assert moved["most"] > 0.3, "and yet other maps"
    for page in ("card.html", "gap.md"):
        assert "learnt from measured readings" in (both.folder / page).read_text()


def test_new_labels_are_needed_where_labels_move(both, tmp_path):
    judged = verdict(tmp_path / "verdict", "latency", {"L": 0.3})
    with pytest.raises(UsageError, match="--relabel"):
        revise(judged, [tmp_path], read_spec(None), tmp_path / "new", RevisionOptions(retrain=Recipe()))
    assert not (tmp_path / "new").exists()


def test_readings_that_the_right_model_says_teach_more(tmp_path, monkeypatch):
    """A filter leaves labels as they are: networks learn from what either model says, and read what was measured."""
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    session = recorded(tmp_path / "bench", 0.3)
    judged = verdict(tmp_path / "verdict", "low_pass_filter", {"tau": 0.3})
    wishes = RevisionOptions(retrain=Recipe(epochs=2, network="direct", threads=1))
    made = revise(judged, [session], read_spec(None), tmp_path / "revision", wishes)
    told = made.document["retrained"]
    assert told["by"] == "readings" and made.document["labels"] == []
    values = np.array([[m["before"], m["after"]] for m in told["metrics"] if m["after"] is not None])
    assert np.isfinite(values).all() and not np.allclose(values[:, 0], values[:, 1])
    assert (made.folder / "networks" / "measured").is_dir(), "both are scored on what was measured"
