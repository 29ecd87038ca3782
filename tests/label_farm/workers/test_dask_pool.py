"""The same jobs on a Dask cluster of this machine."""

import os
import signal
import subprocess
import sys

import pytest
from chaos import ROOT
from farm_examples import HERE
from free_port import free_port
from running.in_process import tacdata
from session_examples import session

from tacdata.label_farm.ledger.ledger import DONE, FAILED, LEASED, MAX_TRIES, WAITING
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.dask_pool import DaskPool, _Task
from tacdata.sensor import default_sensor

pytest.importorskip("distributed")


def label(folder, *options, **variables):
    path = os.pathsep.join([str(HERE), str(ROOT)])  # of the workers
    given = {"PYTHONPATH": path, "FAST_MODEL_LOG": str(folder / "solves.log"), **variables}
    return tacdata("label", "s", "--factory", "fast_model:FastModel", *options, folder=folder, **given)


@pytest.mark.long("label_farm", reason="a cluster of Dask whose workers die")
def test_a_cluster_labels_and_a_press_that_kills_its_worker_is_a_failure(tmp_path):
    session(tmp_path / "s", 6)
    # The second press kills its worker once, the third always, the fourth finds no equilibrium.
    shown = label(
        tmp_path,
        "--dask",
        "here",
        "--workers",
        "2",
        FAST_MODEL_KILLS_ONCE="-5.95",
        FAST_MODEL_KILLS="-5.9",
        FAST_MODEL_FAILS="-5.85",
    )
    assert shown.returncode == 5, shown.stderr
    assert "labels written: 4" in shown.stdout and "failed: 2" in shown.stdout, shown.stdout
    assert "episode 2: no label: its Dask worker died" in shown.stdout
    assert "episode 3: no label: no equilibrium" in shown.stdout
    counted = [line.split()[1] for line in (tmp_path / "solves.log").read_text().splitlines()]
    assert (counted.count("-5.95"), counted.count("-5.9")) == (2, 3)
    assert all(counted.count(x) == 1 for x in ("-6", "-5.85", "-5.8", "-5.75"))


def test_workers_of_other_code_are_refused(tmp_path):
    """The cluster is a host with another version: here by a variable that only its worker has."""
    session(tmp_path / "s", 2)
    path = os.pathsep.join([str(HERE), str(ROOT)])
    other = {**os.environ, "PYTHONPATH": path, "FAST_MODEL_VERSION": "2"}
    address = f"tcp://127.0.0.1:{free_port()}"
    commands = (
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard"],
        [sys.executable, "-m", "tacdata.cli", "farm", "worker", address, "--processes", "1"],
    )
    started = [subprocess.Popen(c, env=other, cwd=tmp_path, stderr=subprocess.DEVNULL) for c in commands]
    try:
        shown = label(tmp_path, "--dask", address)
    finally:
        for process in reversed(started):
            process.send_signal(signal.SIGINT)
            process.wait(60)
    assert shown.returncode == 2 and "has the model asked for" in shown.stderr, shown.stderr
    assert not (tmp_path / "solves.log").exists() and not list((tmp_path / "s" / "labels").glob("*.json"))


def test_what_cannot_be_reached_is_said(tmp_path):
    session(tmp_path / "s", 1)
    shown = label(tmp_path, "--dask", "tcp://127.0.0.1:9")
    assert shown.returncode == 4 and "no Dask scheduler answers" in shown.stderr and "Traceback" not in shown.stderr
    shown = label(tmp_path, "--dask", "there")
    assert shown.returncode == 2 and "tcp://HOST:PORT" in shown.stderr


class LostResult:
    """Of a solve that is done, on a worker that was cut off before the result was fetched."""

    status, cancelled = "finished", False

    def result(self, timeout=None):
        assert timeout is not None, "nobody waits for ever for a worker that is cut off"
        raise TimeoutError

    def cancel(self, force=False):
        self.cancelled = force


def test_a_result_that_went_with_its_worker_is_asked_for_again(tmp_path, monkeypatch):
    model = "a" * 64
    pool = DaskPool(
        Store(tmp_path / "store"), "fast_model:FastModel", {model: default_sensor()}, 0, 60.0, (), "tcp://h:1"
    )
    try:
        monkeypatch.setattr(pool, "_connected", lambda: None)
        monkeypatch.setattr(pool, "_give_out", lambda client: None)
        pool._ledger.enqueue([Job("0" * 64, model, {"shape": "sphere", "radius": 2.0}, 0.0, 0.0, 0.0, (0.0, 1.0, 0.0))])
        for _ in range(MAX_TRIES + 1):
            leases = pool._ledger.claim("somebody", model)
            lost = LostResult()
            pool._given["tcp://two:2"] = [_Task(lost, "somebody", leases)]
            pool.tend(1)
            assert lost.cancelled and "tcp://two:2" not in pool._given, "it would be solved there again"
        assert pool._ledger.counts() == {WAITING: 1, LEASED: 0, DONE: 0, FAILED: 0}, "the press did no harm"
    finally:
        pool._given.clear()
        pool.close()
