"""The store: whole results or none, of one format version."""

import io
import json
import os
import threading
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from farm_examples import SENSOR
from fast_model import path

from tacdata.errors import FormatError, SolveError, UsageError
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store import solution_file
from tacdata.label_farm.store.failure import Failure
from tacdata.label_farm.store.store import Store
from tacdata.labels import columns

JOB = Job(SENSOR.content_hash, "a" * 64, {"shape": "sphere", "radius": 2.0}, 0.5, 0.0, 0.0, (0.0, 0.3, 1.0, 0.4, 0.0))
SOLUTION = path(SENSOR, JOB.depths, lambda d: d**1.5)


def rewritten(data, change):
    """The file with its header changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as old:
        members = {name: old.read(name) for name in old.namelist()}
    header = json.loads(members["header.json"])
    change(header)
    members["header.json"] = json.dumps(header).encode()
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as new:
        for name, content in members.items():
            new.writestr(name, content)
    return stream.getvalue()


def test_a_solution_comes_back_bit_for_bit(tmp_path):
    store = Store(tmp_path / "store")
    assert store.get(JOB) is None
    store.put(JOB, SOLUTION, SENSOR)
    found = Store(tmp_path / "store").get(JOB)
    for name in columns.PATH_REQUIRED:
        assert np.array_equal(getattr(found, name), getattr(SOLUTION, name))
    assert found.provenance == {"law": "bump", "key": JOB.key}
    assert store.path(JOB.key) == tmp_path / "store" / JOB.key[:2] / f"{JOB.key}.npz"


def test_a_store_that_several_make_at_the_same_time_is_everyones(tmp_path):
    together = threading.Barrier(4)

    def make(folder):
        together.wait()
        return Store(folder).folder

    with ThreadPoolExecutor(4) as threads:
        for k in range(20):
            folder = tmp_path / f"{k}" / "store"
            assert list(threads.map(make, 4 * [folder])) == 4 * [folder]


def test_standard_deviations_come_back_where_they_are_known(tmp_path):
    store = Store(tmp_path / "store")
    known = replace(
        SOLUTION,
        uncertainty=0.1 * SOLUTION.surface,
        force_uncertainty=np.abs(SOLUTION.force),
        taxel_force_uncertainty=SOLUTION.taxel_force,
        taxel_closure_uncertainty=SOLUTION.taxel_closure,
    )
    store.put(JOB, known, SENSOR)
    found = Store(tmp_path / "store").get(JOB)
    for name in columns.PATH_OPTIONAL:
        assert np.array_equal(getattr(found, name), getattr(known, name))
    store.put(JOB, SOLUTION, SENSOR)
    assert store.get(JOB).uncertainty is None


def test_any_tool_can_read_a_result_without_pickle(tmp_path):
    store = Store(tmp_path / "store")
    store.put(JOB, SOLUTION, SENSOR)
    with np.load(store.path(JOB.key), allow_pickle=False) as arrays:
        assert np.array_equal(arrays["surface"], SOLUTION.surface)


def test_equal_results_are_equal_files(tmp_path):
    assert solution_file.encode(JOB, SOLUTION) == solution_file.encode(JOB, SOLUTION)


def test_every_damaged_byte_is_noticed_or_harmless():
    data = solution_file.encode(JOB, SOLUTION)
    noticed = 0
    for position in np.random.default_rng(1).integers(0, len(data), 200):
        broken = bytearray(data)
        broken[position] ^= 0x10
        try:
            _, found = solution_file.decode(bytes(broken), "x")
        except FormatError:
            noticed += 1
        else:
            assert np.array_equal(found.surface, SOLUTION.surface)
    assert noticed > 150


def test_a_result_under_a_wrong_name_is_not_taken_for_another(tmp_path):
    store = Store(tmp_path / "store")
    other = replace(JOB, x=1.0)
    store.put(JOB, SOLUTION, SENSOR)
    store.path(other.key).parent.mkdir(exist_ok=True)
    store.path(other.key).write_bytes(store.path(JOB.key).read_bytes())
    assert store.get(other) is None and store.intact(JOB)


def test_another_format_version_is_an_error_and_nothing_is_put_aside(tmp_path):
    store = Store(tmp_path / "store")
    store.put(JOB, SOLUTION, SENSOR)
    result = store.path(JOB.key)
    result.write_bytes(rewritten(result.read_bytes(), lambda header: header.update(version="9.0")))
    with pytest.raises(FormatError, match=r"format version 9\.0"):
        store.get(JOB)
    assert result.exists()
    mark = tmp_path / "store" / "store.json"
    mark.write_text(mark.read_text().replace('"1.0"', '"2.0"'))
    with pytest.raises(FormatError, match=r"version 2\.0"):
        Store(tmp_path / "store")


def test_a_header_that_contradicts_its_arrays_is_damage(tmp_path):
    data = solution_file.encode(JOB, SOLUTION)
    for change in (
        lambda h: h["arrays"]["force"].update(shape=[1]),
        lambda h: h["job"].update(x=9.0),
        lambda h: h["arrays"].pop("force"),
        lambda h: h.update(key="nonsense"),
        lambda h: h.pop("job"),
    ):
        with pytest.raises(FormatError):
            solution_file.decode(rewritten(data, change), "x")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"surface": np.full_like(SOLUTION.surface, np.nan)}, "finite"),
        ({"surface": SOLUTION.surface[:, :-1]}, "shape"),
        ({"uncertainty": SOLUTION.surface * np.nan}, "returned uncertainty"),
        ({"force_uncertainty": SOLUTION.force[:, :2]}, "returned force_uncertainty"),
        ({"depth": np.array([0.0, 0.3, 0.9, 0.4, 0.0])}, "path from 0 to 1 mm"),
        ({"depth": np.array([0.0, 1.0, 0.5, 0.7, 0.0])}, "path from 0"),
        ({"depth": np.array([0.1, 0.3, 1.0, 0.4, 0.0])}, "path from 0"),
    ],
)
def test_what_must_not_become_a_label_is_refused(tmp_path, change, word):
    store = Store(tmp_path / "store")
    with pytest.raises(SolveError, match=word):
        store.put(JOB, replace(SOLUTION, **change), SENSOR)
    assert not list((tmp_path / "store").rglob("*.npz"))


def test_a_failure_is_kept_until_a_result_replaces_it(tmp_path):
    store = Store(tmp_path / "store")
    store.put_failure(JOB, Failure("solve", "no equilibrium", "Traceback", 2))
    assert store.failure(JOB.key) == Failure("solve", "no equilibrium", "Traceback", 2)
    assert not store.intact(JOB)
    store.put(JOB, SOLUTION, SENSOR)
    assert store.failure(JOB.key) is None


def test_a_folder_that_is_no_store_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match="no label store"):
        Store(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["thesis.tex"]
    with pytest.raises(UsageError):
        Store(tmp_path / "thesis.tex")


def test_what_a_killed_writer_left_is_swept_when_it_is_old(tmp_path):
    Store(tmp_path / "store")
    old, young = tmp_path / "store" / "writing" / "old", tmp_path / "store" / "writing" / "young"
    old.write_text("half"), young.write_text("half")
    os.utime(old, (1e9, 1e9))
    Store(tmp_path / "store")
    assert not old.exists() and young.exists()
