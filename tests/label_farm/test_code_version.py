"""The version of code that decides a result: what changes it, and what an earlier release left stays readable."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from farm_examples import HERE, SENSOR, label_episodes, press_episode

import tacdata
from label_farm.labels import make_label
from label_farm.presses.job import Job
from label_farm.store.store import Store
from tacdata import provenance
from tacdata.labels import read_label

EARLIER = HERE / "earlier_release"
"""A label and its stored solution, written by the commit f8471ad with the fast model."""
COARSE = replace(SENSOR, map=replace(SENSOR.map, pixels_x=12, pixels_y=12, pixel_pitch=0.8))


@pytest.fixture(autouse=True)
def no_version_is_remembered():
    provenance.code_hash.cache_clear()
    yield
    provenance.code_hash.cache_clear()


@pytest.fixture
def edited(tmp_path, monkeypatch):
    """Return a function that edits a file in a copy of the skin's rooms and returns the copy's version."""
    copy = tmp_path / f"copied_for_{tmp_path.name}"  # a name is imported once in a process
    shutil.copytree(Path(tacdata.__path__[0]) / "skin", copy, ignore=shutil.ignore_patterns("shipped", "__pycache__"))
    monkeypatch.syspath_prepend(tmp_path)

    def edit(file, before, after):
        text = (copy / file).read_text()
        assert before in text
        (copy / file).write_text(text.replace(before, after, 1))
        provenance.code_hash.cache_clear()
        return provenance.code_hash(copy.name, without=(f"{copy.name}.derivatives",))

    return edit


def test_words_and_layout_leave_the_version_and_a_constant_changes_it(edited):
    before = provenance.code_hash("tacdata.skin", without=("tacdata.skin.derivatives",))
    file = "model.py"
    assert edited(file, '"""The skin model: presses go in', '"""Presses go in') == before, "a module's docstring"
    assert edited(file, '"""Longest load step upward', '"""Longest step upward') == before, "a constant's docstring"
    assert edited(file, '        """The same skin on a coarser mesh', '        """A coarser mesh') == before, (
        "a method's"
    )
    assert edited(file, "_LIFT = 0.5\n", "# Chosen by hand.\n_LIFT = (\n    0.5  # a half\n)\n") == before, "comments"
    assert edited(file, "    0.5  # a half\n", "    0.6  # a half\n") != before, "a constant"


def test_what_decides_nothing_leaves_the_version(edited):
    before = provenance.code_hash("tacdata.skin", without=("tacdata.skin.derivatives",))
    assert edited("derivatives/path_uncertainty.py", "\nimport ", "\nimport os\nimport ") == before
    assert edited("solve/newton.py", "\nimport ", "\nimport os\nimport ") != before


def test_an_added_file_changes_the_version(edited, tmp_path):
    before = edited("model.py", "_LIFT = 0.5", "_LIFT = 0.5")
    (next(tmp_path.glob("copied*")) / "materials" / "new_law.py").write_text("STIFFNESS = 1.0\n")
    assert edited("model.py", "_LIFT = 0.5", "_LIFT = 0.5") != before


def test_a_version_shown_to_be_equal_goes_by_the_older_name_until_the_code_changes(edited, monkeypatch):
    before = edited("model.py", "_LIFT = 0.5", "_LIFT = 0.5")
    monkeypatch.setattr(provenance, "EQUAL_VERSIONS", {before: ("older", "identical on 12 presses")})
    assert edited("model.py", "_LIFT = 0.5", "_LIFT =  0.5") == "older"
    assert edited("model.py", "_LIFT =  0.5", "_LIFT = 0.6") not in ("older", before)


def test_a_name_without_a_module_is_refused():
    with pytest.raises(ModuleNotFoundError, match=r"no module tacdata\.skinn"):
        provenance.code_hash("tacdata.skinn")


def test_a_label_of_an_earlier_release_is_read_and_its_solution_used_again(tmp_path, solves):
    shutil.copytree(EARLIER, tmp_path / "labels")
    path = tmp_path / "labels" / "episode-000000.parquet"
    earlier = read_label(path)
    assert float(earlier.force[:, 2].min()) < 0
    assert earlier.provenance["parents"]["label_farm"] != make_label.code_hash()
    job = Job.from_document(earlier.provenance["parameters"]["job"])
    solution = Store(tmp_path / "labels" / "store").get(job)
    assert solution is not None and solution.depth.max() == job.deepest == pytest.approx(0.4)
    summary = label_episodes(tmp_path / "labels", [press_episode(tmp_path, frames=6, depth=0.4)], sensor=COARSE)
    assert (summary.written, solves()) == ([0], [])
    label = read_label(path)
    assert label.provenance["parents"]["label_farm"] == make_label.code_hash()
    for name in ("signed", "error_map", "force", "taxel_force", "taxel_counts"):
        assert np.array_equal(getattr(label, name), getattr(earlier, name)), name


def test_a_label_of_an_equal_version_stays_current(tmp_path, solves, monkeypatch):
    shutil.copytree(EARLIER, tmp_path / "labels")
    path = tmp_path / "labels" / "episode-000000.parquet"
    older = read_label(path).provenance["parents"]["label_farm"]
    monkeypatch.setattr(provenance, "EQUAL_VERSIONS", {make_label.code_hash(): (older, "identical on this press")})
    provenance.code_hash.cache_clear()
    before = path.read_bytes()
    summary = label_episodes(tmp_path / "labels", [press_episode(tmp_path, frames=6, depth=0.4)], sensor=COARSE)
    assert (summary.current, summary.written, solves()) == ([0], [], []) and path.read_bytes() == before
