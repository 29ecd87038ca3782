"""The version of code that decides a result: what changes it, and what an earlier release left stays readable."""

import ast
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from farm_examples import HERE, SENSOR, label_episodes, press_episode

import tacdata
from tacdata import provenance
from tacdata.label_farm.labels import make_label
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.store.store import Store
from tacdata.labels import read_label

EARLIER = HERE / "labels" / "earlier_release"
"""A label and its stored solution, written by the commit f8471ad with the fast model."""
THEN = Ladder(first_step=0.05, growth=1.6, unload_step=0.25)
"""How its states were spaced."""
COARSE = replace(SENSOR, map=replace(SENSOR.map, pixels_x=12, pixels_y=12, pixel_pitch=0.8))


@pytest.fixture(autouse=True)
def no_version_is_remembered(monkeypatch):
    monkeypatch.setattr(provenance, "EQUAL_VERSIONS", {})
    provenance.code_hash.cache_clear()
    yield
    provenance.code_hash.cache_clear()


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """A copy of the skin's rooms, as a package of its own name: a name is imported once in a process."""
    folder = tmp_path / f"copied_for_{tmp_path.name}"
    shutil.copytree(Path(tacdata.__path__[0]) / "skin", folder, ignore=shutil.ignore_patterns("shipped", "__pycache__"))
    monkeypatch.syspath_prepend(tmp_path)
    return folder


def version(folder):
    provenance.code_hash.cache_clear()
    return provenance.code_hash(folder.name, without=(f"{folder.name}.derivatives",))


def reworded(text):
    """Return a source with other docstrings, of a field or a constant too, and comments between its statements."""
    lines, found = text.splitlines(), 0
    for node in sorted((n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Expr)), key=lambda n: -n.lineno):
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            indent = " " * node.col_offset
            lines[node.lineno - 1 : node.end_lineno] = [f'{indent}"""Other words."""', f"{indent}# A comment.", ""]
            found += 1
    assert found
    return "\n".join(lines) + "\n"


def with_another_number(text):
    """Return a source with its first number a thousandth larger."""
    node = next(n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant) and isinstance(n.value, float))
    lines = text.splitlines(keepends=True)
    line = lines[node.lineno - 1]
    lines[node.lineno - 1] = f"{line[: node.col_offset]}{1.001 * node.value}{line[node.end_col_offset :]}"
    return "".join(lines)


def edit(path, change):
    path.write_text(change(path.read_text()))


def test_words_and_layout_leave_the_version_and_a_constant_changes_it(copied):
    before = provenance.code_hash("tacdata.skin", without=("tacdata.skin.derivatives",))
    for path in ("model.py", "solve/newton.py", "materials/neo_hookean.py"):
        edit(copied / path, reworded)
    assert version(copied) == before
    edit(copied / "solve/newton.py", with_another_number)
    assert version(copied) != before


def test_what_decides_nothing_leaves_the_version(copied):
    before = version(copied)
    (changed, *_) = sorted((copied / "derivatives").glob("[a-z]*.py"))
    edit(changed, lambda text: text + "STEP = 1.0\n")
    assert version(copied) == before


def test_an_added_file_changes_the_version(copied):
    before = version(copied)
    (copied / "materials" / "new_law.py").write_text("STIFFNESS = 1.0\n")
    assert version(copied) != before


def test_a_version_shown_to_be_equal_goes_by_the_older_name_until_the_code_changes(copied, monkeypatch):
    before = version(copied)
    monkeypatch.setattr(provenance, "EQUAL_VERSIONS", {before: ("older", "identical on 12 presses")})
    edit(copied / "solve/newton.py", reworded)
    assert version(copied) == "older"
    edit(copied / "solve/newton.py", with_another_number)
    assert version(copied) not in ("older", before)


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
    episodes = [press_episode(tmp_path, frames=6, depth=0.4)]
    summary = label_episodes(tmp_path / "labels", episodes, sensor=COARSE, ladder=THEN)
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
    episodes = [press_episode(tmp_path, frames=6, depth=0.4)]
    summary = label_episodes(tmp_path / "labels", episodes, sensor=COARSE, ladder=THEN)
    assert (summary.current, summary.written, solves()) == ([0], [], []) and path.read_bytes() == before


@pytest.mark.parametrize("damage", [None, b"", b"half a checksum", b"0\n12"])
def test_a_version_from_the_cache_is_the_one_that_parsing_gives(copied, tmp_path, monkeypatch, damage):
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "cache"))
    parsed = version(copied)
    [entry] = (tmp_path / "cache" / "results" / "code").iterdir()
    if damage is not None:
        entry.write_bytes(damage)
    assert version(copied) == parsed
    solver = copied / "solve" / "settings.py"
    solver.write_text(reworded(solver.read_text()))
    assert version(copied) == parsed
    solver.write_text(solver.read_text().replace("patience: int = 12", "patience: int = 13"))
    assert version(copied) != parsed


def test_a_cache_that_cannot_be_written_leaves_the_version(copied, tmp_path, monkeypatch):
    parsed = version(copied)
    (tmp_path / "a file").touch()
    monkeypatch.setenv("TACDATA_CACHE", str(tmp_path / "a file"))
    assert version(copied) == parsed
