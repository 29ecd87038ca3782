"""Workers die at the worst moment or cannot start: each label is still made once, or words say why not."""

import sys

import pytest
from farm_examples import SENSOR, label_episodes, press_episode

from tacdata.errors import SolveError, UsageError
from tacdata.label_farm.labels.request import request
from tacdata.label_farm.ledger.ledger import WAITING, Ledger
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.pool import Pool


def episodes(folder, count):
    return [press_episode(folder, k, x=float(k)) for k in range(count)]


def labels_in(folder):
    return sorted(int(p.stem[-6:]) for p in (folder / "labels").glob("episode-*.parquet"))


def test_a_worker_killed_in_mid_job_costs_nothing_but_time(tmp_path, label_by_workers, solves, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_KILLS_ONCE", "2")
    summary = label_by_workers(episodes(tmp_path, 5))
    assert sorted(summary.written) == [0, 1, 2, 3, 4] == labels_in(tmp_path) and not summary.failed
    assert sorted(x for _, x in solves()) == ["0", "1", "2", "2", "3", "4"]


def test_a_press_that_always_kills_its_worker_is_a_failure_and_stops_no_other(
    tmp_path, label_by_workers, solves, monkeypatch
):
    monkeypatch.setenv("FAST_MODEL_KILLS", "1")
    summary = label_by_workers(episodes(tmp_path, 3))
    assert sorted(summary.written) == [0, 2] and "signal 9 in each of 3 tries" in summary.failed[1]
    assert [x for _, x in solves()].count("1") == 3
    monkeypatch.delenv("FAST_MODEL_KILLS")
    assert label_by_workers(episodes(tmp_path, 3)).written == [1], "a crash is worth another try"


def pool_of_one(tmp_path, factory, version):
    """A pool with one job of a model version."""
    job = request(press_episode(tmp_path), SENSOR, version, Ladder()).job
    store = Store(tmp_path / "store")
    with Ledger(store.ledger_path) as ledger:
        ledger.enqueue([job])
    return Pool(store, factory, {version: SENSOR}, 1), job


def test_workers_of_other_code_are_refused(tmp_path, solves, monkeypatch):
    version = model.version("fast_model:FastModel", SENSOR).content_hash
    monkeypatch.setenv("FAST_MODEL_VERSION", "2")
    pool, job = pool_of_one(tmp_path, "fast_model:FastModel", version)
    with pytest.raises(UsageError, match="other code"):
        pool.run({job.key}, 0, lambda change: None)
    pool.close()
    assert not solves() and not pool.processes


def test_workers_that_cannot_build_their_model_end_the_run_and_blame_no_press(tmp_path, solves):
    pool, job = pool_of_one(tmp_path, "missing_module:Model", "a" * 64)
    with pytest.raises(SolveError, match="died in a row") as error:
        pool.run({job.key}, 0, lambda change: None)
    assert "missing_module" in str(error.value)
    pool.close()
    with Ledger(pool.store.ledger_path) as ledger:
        assert ledger.counts()[WAITING] == 1 and pool.store.failure(job.key) is None


def test_a_store_that_cannot_be_written_is_said_in_words(tmp_path, solves):
    """The workers' results go where a file stands in the way of the folder."""
    store = Store(tmp_path / "labels" / "store")
    (store.folder / "logs").write_text("in the way")
    with pytest.raises(UsageError, match="cannot be written"):
        label_episodes(tmp_path / "labels", episodes(tmp_path, 1))


def test_a_dead_model_process_is_said_in_words(monkeypatch, solves):
    monkeypatch.setattr(model.environment, "python", lambda module: [sys.executable, "-c", "import os; os.abort()"])
    with pytest.raises(SolveError, match="cannot be built"):
        model.version("fast_model:FastModel", SENSOR)
