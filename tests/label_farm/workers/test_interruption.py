"""Runs that are interrupted, killed or started twice: each label is made once, and the next run goes on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from farm_examples import HERE, press_episode
from gate import Gate
from session_examples import session

SCRIPT = """
import sys
from pathlib import Path
from farm_examples import label_episodes, press_episode
folder = Path(sys.argv[1])
episodes = [press_episode(folder, k, x=float(k)) for k in range(int(sys.argv[2]))]
try:
    # A machine that stands still for seconds takes no press from a worker: who is dead is told by its process.
    summary = label_episodes(folder / "labels", episodes, lease_seconds=60.0)
except KeyboardInterrupt:
    sys.exit(130)
print(len(summary.written), len(summary.failed))
"""

STAGE = """
import sys
from tacdata import stages
stages.Line(1, "").run("label", ["label", sys.argv[1], "--factory", "fast_model:FastModel", "--workers", "2"])
"""


def episodes(folder, count):
    return [press_episode(folder, k, x=float(k)) for k in range(count)]


def start(folder, count):
    root = HERE.parent.parent
    path = os.pathsep.join([str(HERE), str(root)])
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder), str(count)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        cwd=root,
    )


def wait_for(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


def labels_in(folder):
    return sorted(int(p.stem[-6:]) for p in (folder / "labels").glob("episode-*.parquet"))


def alive(process):
    try:
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


@pytest.mark.long("label_farm", reason="two runs of processes that take jobs from each other")
def test_two_runs_on_one_store_share_the_work(tmp_path, solves, monkeypatch):
    monkeypatch.setenv("FAST_MODEL_SECONDS", "0.1")
    episodes(tmp_path, 8)  # recorded before either run reads them
    runs = [start(tmp_path, 8), start(tmp_path, 8)]
    answers = [run.communicate(timeout=100) for run in runs]
    assert [run.returncode for run in runs] == [0, 0], answers
    assert sorted(x for _, x in solves()) == [str(k) for k in range(8)]
    assert labels_in(tmp_path) == list(range(8))


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_stopped_goes_on_where_it_stood(tmp_path, label_all, solves, monkeypatch, how):
    count = 16
    gate = Gate(tmp_path / "gate")
    for name, value in gate.variables.items():
        monkeypatch.setenv(name, value)
    gate.let(3)
    run = start(tmp_path, count)
    wait_for(lambda: len(labels_in(tmp_path)) == 3 and len(solves()) == 5)
    workers = {int(process) for process, _ in solves()}
    run.send_signal(how)
    _, errors = run.communicate(timeout=100)
    assert run.returncode == (130 if how == signal.SIGINT else -9), errors
    wait_for(lambda: not any(alive(worker) for worker in workers))
    kept = {p: p.read_bytes() for p in (tmp_path / "labels").glob("*.parquet")}
    results = len(list((tmp_path / "labels" / "store").rglob("*.npz")))
    assert len(kept) == results == 3
    begun = len(solves())
    gate.open()
    summary = label_all(episodes(tmp_path, count))
    assert labels_in(tmp_path) == list(range(count)) and not summary.failed
    assert len(solves()) - begun == count - results, "only what was not finished is computed"
    assert all(path.read_bytes() == content for path, content in kept.items())


def test_workers_end_with_whoever_runs_the_verb_as_a_stage(tmp_path, solves, monkeypatch):
    """As `tacdata demo` does: killed, it leaves nobody behind who goes on solving."""
    for name, value in Gate(tmp_path / "gate").variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), str(HERE.parent.parent)]))
    recorded = session(tmp_path / "session", 3)
    with subprocess.Popen([sys.executable, "-c", STAGE, str(recorded)], stdout=subprocess.DEVNULL) as parent:
        wait_for(lambda: len(solves()) == 2)
        parent.kill()
    wait_for(lambda: not any(alive(int(worker)) for worker, _ in solves()))
