"""The commands of the page on the label farm run as they stand, with a stand-in model in place of finite elements."""

import os
import shlex
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from chaos import all_finished
from farm_examples import HERE
from free_port import free_port
from running.in_process import tacdata
from running.typed_pages import HOW_TO, blocks
from session_examples import session

from tacdata.label_farm.remote.client import Client

PAGE = HOW_TO / "label_farm.md"
ROOT = HOW_TO.parents[1]
PARTS = [[shlex.split(line, comments=True) for line in body.splitlines()] for body in blocks(PAGE, "sh")]
"""One list of commands a block, each with its first word."""
FACTORY = ("--factory", "fast_model:FastModel")
TOKEN = "0123456789abcdef0123"


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """A folder with sessions as the page names them, and the stand-in model where workers find it."""
    session(tmp_path / "session", 2)
    session(tmp_path / "sessions" / "monday", 3, first=2)
    session(tmp_path / "data" / "sessions" / "monday", 3, first=2)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), str(ROOT)]))
    monkeypatch.syspath_prepend(HERE)
    monkeypatch.setenv("FAST_MODEL_LOG", str(tmp_path / "solves.log"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    return tmp_path


def typed(folder, words, *more, code=0, **variables):
    """Type a command of the page; return what it said."""
    assert words[0] == "tacdata"
    done = tacdata(*words[1:], *more, folder=folder, COLUMNS="200", **variables)
    assert done.returncode == code, f"{shlex.join(words)}: {done.stdout}{done.stderr}"
    return done.stdout


TYPED = pytest.mark.long("label_farm", "docs/how_to/label_farm.md", reason="a page typed, each verb a process")


@contextmanager
def started(folder, words, *more, says="", **variables):
    """A command of the page that runs until it is ended, once it has said something; yields that line."""
    command = [sys.executable, "-m", "tacdata.cli", *words[1:]] if words[0] == "tacdata" else words
    environment = {**os.environ, **variables}
    log = (folder / "log").open("w")
    with (
        log,
        subprocess.Popen(
            [*command, *more], cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=log, text=True
        ) as process,
    ):
        try:
            yield next((line for line in process.stdout if says in line), "") if says else ""
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(60)


@contextmanager
def service(folder, words, *more, root="data", **variables):
    """`tacdata farm up` as the page types it, on a free port; yields its address."""
    words = [str(folder / root) if word == "/data" else word for word in words]
    with started(folder, words, "--port", "0", "--workers", "1", *FACTORY, *more, says=" at http", **variables) as line:
        assert line, (folder / "log").read_text()
        yield f"http://127.0.0.1:{line.rpartition(':')[2].strip()}"


def finished(client):
    """Wait until all that was submitted is done; return the state."""
    end = time.monotonic() + 120
    while not all_finished(state := client.get("/api/state")):
        assert time.monotonic() < end, state
        time.sleep(0.1)
    return state


def test_every_command_of_the_page_has_its_test():
    verbs = [[" ".join(words[1:3]) if words[0] == "tacdata" else words[0] for words in part] for part in PARTS]
    assert verbs == [
        ["label session"],
        ["farm up", "farm submit", "farm status"],
        ["export", "farm up"],
        ["export", "farm send", "farm submit", "farm fetch"],
        ["farm worker"],
        ["dask", "farm up", "farm worker"],
        ["farm dataset"],
    ]


@TYPED
def test_a_session_and_a_service_of_one_computer(bench):
    assert "labels written: 2" in typed(bench, PARTS[0][0], "--workers", "1", *FACTORY)
    up, submit, status = PARTS[1]
    with service(bench, up) as address:
        typed(bench, submit, TACDATA_FARM_URL=address)
        state = finished(Client(address, ""))
        assert "sessions/monday" in typed(bench, status, TACDATA_FARM_URL=address)
    assert state["submissions"][0]["labelled"] == 3
    listed = typed(bench / "data", PARTS[6][0], *FACTORY)
    assert "complete" in listed, listed


@TYPED
def test_recordings_go_to_another_computer_and_labels_come_back(bench):
    export, up = PARTS[2]
    made = subprocess.run(
        ["sh", "-c", blocks(PAGE, "sh")[2].splitlines()[0] + "; echo $TACDATA_FARM_TOKEN"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PATH": os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]])},
    )
    token = {"TACDATA_FARM_TOKEN": made.stdout.strip()}
    assert export[0] == "export" and len(token["TACDATA_FARM_TOKEN"]) >= 16
    (bench / "away").mkdir()
    with service(bench, up, root="away", **token) as address:
        known = {"TACDATA_FARM_URL": address, **token}
        _, send, submit, fetch = PARTS[3]
        typed(bench, send, **known)
        typed(bench, submit, **known)
        assert "labels fetched: 3" in typed(bench, fetch, **known)
    assert len(list((bench / "sessions" / "monday" / "labels").glob("episode-*.parquet"))) == 3


@TYPED
def test_workers_of_more_computers(bench):
    """The service has no worker of its own: who labels came by the page's command."""
    _, submit, _ = PARTS[1]
    (worker,) = PARTS[4]
    with service(bench, PARTS[1][0], "--workers", "0") as address:
        words = [address if word == "http://HOST:8765" else word for word in worker]
        with started(bench, words, "--processes", "1", *FACTORY):
            typed(bench, submit, TACDATA_FARM_URL=address)
            state = finished(Client(address, ""))
            assert all(row["owner"].startswith("remote:") for row in state["workers"])


@TYPED
def test_workers_of_a_cluster(bench):
    scheduler, up, worker = PARTS[5]
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    ours = {"HOST": "127.0.0.1", "tcp://HOST:8786": address}
    scheduler, up, worker = ([ours.get(word, word) for word in words] for words in (scheduler, up, worker))
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", *scheduler[2:]]
    with started(bench, dask, "--port", str(port), "--no-dashboard"):
        with started(bench, worker, "--processes", "1"), service(bench, up) as served:
            typed(bench, PARTS[1][1], TACDATA_FARM_URL=served)
            assert finished(Client(served, ""))["submissions"][0]["labelled"] == 3
