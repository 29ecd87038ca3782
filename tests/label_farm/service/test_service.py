"""The service over HTTP: submissions that outlive it, several people, cancel, priority, refusals, remote workers."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request

import pytest
from chaos import ROOT, Service, all_finished, record
from farm_examples import HERE
from gate import Gate
from running.in_process import tacdata

from tacdata.errors import UsageError
from tacdata.label_farm.service.confined import confined

TOKEN = "0123456789abcdef0123"
SECONDS = 0.05
"""What a press takes at least."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    record(folder, 2, 4)
    return folder


@pytest.fixture(scope="module")
def gate(recorded):
    """What the presses of `busy` wait for."""
    return Gate(recorded / "gate")


@pytest.fixture(scope="module")
def busy(recorded, gate):
    """A service with one worker."""
    with Service(recorded, workers=1, seconds=SECONDS, gate=gate) as service:
        yield service


def ask(service, path, method="GET", body=None, **headers):
    """Return (status, headers, content) without any of the client's own manners."""
    request = urllib.request.Request(service.url + path, data=body, method=method, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers, error.read()


def verb(*arguments, **variables):
    return tacdata(*arguments, COLUMNS="200", **variables)


def test_two_people_submit_and_the_more_urgent_comes_first(busy, gate):
    client = busy.client()
    first = client.post("/api/submissions", {"session": "session-0", "by": "ann"})
    second = client.post("/api/submissions", {"session": "session-1", "by": "ben", "priority": 5})
    assert (first["id"], second["id"]) == ("000001", "000002")
    busy.wait(lambda state: state["presses"]["waiting"] + state["presses"]["in_work"] == 8)
    gate.open()
    state = busy.wait(lambda state: all_finished(state) and state)
    ended = {entry["by"]: entry for entry in state["submissions"]}
    assert [entry["labelled"] for entry in ended.values()] == [4, 4]
    solved = [float(line.split()[1]) for line in (busy.folder / "solves.log").read_text().splitlines()]
    assert len(solved) == 8, "nothing twice"
    # Session 1 lies to the right of session 0; at most what was in work already came before it.
    assert sum(x > -5.81 for x in solved[:5]) == 4, solved
    (worker,) = state["workers"]
    assert state["seconds_left"] == 0 and worker["done"] == 8 and worker["busy"] > 8 * SECONDS
    assert worker["rate"] == pytest.approx(8 / worker["busy"])
    again = client.post("/api/submissions", {"session": "session-0", "by": "ann"})
    busy.wait(all_finished)
    assert client.get(f"/api/submissions/{again['id']}")["labelled"] == 4
    assert len((busy.folder / "solves.log").read_text().splitlines()) == 8, "nothing is solved again"


def test_prometheus_reads_what_the_page_shows(busy):
    status, headers, content = ask(busy, "/metrics")
    assert status == 200 and headers["Content-Type"].startswith("text/plain; version=0.0.4")
    told = {}
    for line in content.decode().splitlines():
        if not line.startswith("#"):
            name, _, value = line.rpartition(" ")
            told[name] = float(value)
    state = busy.client().get("/api/state")
    assert told['tacdata_farm_presses{state="solved"}'] == state["presses"]["solved"] == 8
    assert [told[f'tacdata_farm_submissions{{state="{s}"}}'] for s in ("done", "refused")] == [3, 0]
    worker = state["workers"][0]
    assert told[f'tacdata_farm_worker_done_total{{worker="{worker["owner"]}",device="cpu"}}'] == worker["done"] == 8
    assert told["tacdata_farm_paused"] == 0


def test_a_preview_is_a_picture_of_the_deepest_frame(busy):
    status, headers, content = ask(busy, "/api/submissions/000001/labels/2.png")
    assert status == 200 and content.startswith(b"\x89PNG") and 0.7 < float(headers["X-Depth"]) <= 0.8
    status, _, content = ask(busy, "/api/submissions/000001/labels/77.png")
    assert status == 400 and b"no label file" in content
    assert ask(busy, "/api/submissions/999999/labels/2.png")[0] == 400


@pytest.mark.parametrize(
    "session", ["../..", "/etc", "session-0/../../x", "a\\b", "", "link", "session-0\0", "nowhere"]
)
def test_paths_stay_under_the_root(busy, session):
    if not (busy.folder / "link").exists():
        (busy.folder / "link").symlink_to("/etc")
    body = json.dumps({"session": session, "by": "eve"}).encode()
    status, _, content = ask(busy, "/api/submissions", "POST", body, **{"Content-Type": "application/json"})
    assert status in (400, 422) and b"root" not in content.replace(busy.folder.name.encode(), b"")


def test_confined_follows_links(tmp_path):
    (tmp_path / "inside").mkdir()
    (tmp_path / "alias").symlink_to(tmp_path / "inside")
    assert confined(tmp_path, "alias", "session") == (tmp_path / "inside").resolve()
    with pytest.raises(UsageError):
        confined(tmp_path, "alias/../..", "session")


def test_what_does_not_fit_is_refused_in_words(busy):
    kind = {"Content-Type": "application/json"}
    status, _, content = ask(busy, "/api/submissions", "POST", b"x" * 70_000, **kind)
    assert status == 413 and "at most 65536" in json.loads(content)["allowed"]
    assert (
        ask(busy, "/api/submissions", "POST", b'{"session": "a", "by": "b", "factory": "os:system"}', **kind)[0] == 422
    )
    assert ask(busy, "/api/submissions", "POST", b"\x80\x04nonsense", **kind)[0] in (400, 422)
    for wish in (b'{"session": "\\ud800", "by": "eve"}', b'{"session": "a", "by": "eve", "tolerance": NaN}', b"[" * 9):
        status, _, content = ask(busy, "/api/submissions", "POST", wish, **kind)
        assert status == 422 and json.loads(content)["next"] == "correct it", content
    long = json.dumps({"session": "a" * 300, "by": "eve"}).encode()
    assert ask(busy, "/api/submissions", "POST", long, **kind)[0] == 400
    status, _, content = ask(busy, "/api/state", Host="farm.example.org")
    assert status == 403 and "localhost" in json.loads(content)["allowed"]
    assert ask(busy, "/api/submissions", "POST", b"{}", Origin="https://example.org", **kind)[0] == 403
    status, _, content = ask(busy, "/api/work/results/" + "0" * 64, "POST", b"PK\x03\x04", **{"X-Owner": "a/1"})
    assert status == 422 and b"result" in content
    status, headers, _ = ask(busy, "/")
    assert status == 200 and "default-src 'none'" in headers["Content-Security-Policy"]
    described = json.loads(ask(busy, "/openapi.json")[2])
    assert {"/api/submissions", "/api/work/claim", "/api/state"} <= set(described["paths"])


def test_a_second_service_on_the_store_is_refused(busy):
    shown = verb("farm", "up", "--root", str(busy.folder), "--port", "0")
    assert shown.returncode == 2 and "another service works on" in shown.stderr and busy.url in shown.stderr
    assert "Traceback" not in shown.stderr


def test_a_cancelled_submission_leaves_and_its_finished_labels_stay(tmp_path):
    record(tmp_path, 1, 12)
    gate = Gate(tmp_path / "gate")
    with Service(tmp_path, workers=1, seconds=0.0, gate=gate) as service:
        shown = verb("farm", "submit", "session-0", "--url", service.url, "--by", "ann", "--priority", "2")
        assert shown.returncode == 0 and "submission 000001" in shown.stdout, shown.stderr
        gate.let(2)
        service.wait(lambda state: state["submissions"][0]["labelled"] == 2)
        shown = verb("farm", "cancel", "000001", "--url", service.url)
        assert shown.returncode == 0 and "is cancelled" in shown.stdout, shown.stderr
        gate.open()
        service.wait(lambda state: state["presses"]["waiting"] == state["presses"]["in_work"] == 0)
        count = len(list((tmp_path / "session-0" / "labels").glob("*.parquet")))
        assert 2 <= count < 12
        shown = verb("farm", "cancel", "000001", "--url", service.url)
        assert shown.returncode == 2 and "is cancelled" in shown.stderr
        assert "cancelled" in verb("farm", "status", "--url", service.url).stdout


def test_failures_keep_their_reason_and_a_broken_session_is_refused(tmp_path):
    record(tmp_path, 1, 3)
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "session.json").write_text("{")
    (tmp_path / "session-0" / "episode-000001.mcap").write_bytes(b"not a recording")
    (tmp_path / "skin.yaml").write_text("version: [")
    with Service(tmp_path, workers=1, seconds=0.0, FAST_MODEL_FAILS="-5.9") as service:
        client = service.client()
        for wish in ({"session": "session-0"}, {"session": "empty"}, {"session": "broken"}):
            client.post("/api/submissions", {**wish, "by": "ann"})
        client.post("/api/submissions", {"session": "session-0", "by": "ann", "sensor": "skin.yaml"})
        with pytest.raises(UsageError, match="no sensor file"):
            client.post("/api/submissions", {"session": "session-0", "by": "ann", "sensor": "missing.yaml"})
        state = service.wait(lambda state: all_finished(state) and state)
        mixed, *refused = state["submissions"]
        assert (mixed["state"], mixed["labelled"], mixed["failed"]) == ("done", 1, 2)
        assert "no equilibrium" in mixed["failures"]["2"] and "episode-000001.mcap" in mixed["failures"]["1"]
        assert [entry["state"] for entry in refused] == ["refused"] * 3
        assert "skin.yaml" in refused[2]["reason"] and "next:" in refused[2]["reason"]
        shown = verb("farm", "status", "000001", "--url", service.url, "--wait")
        assert shown.returncode == 5 and "episode 2: no label" in shown.stdout
        shown = verb("farm", "submit", "broken", "--url", service.url)
        assert shown.returncode == 5 and "submission 000005 is refused: " in shown.stderr, shown.stderr
        assert "session.json" in shown.stderr and shown.stderr.count("next:") == shown.stderr.count("allowed:") == 1
        shown = verb("farm", "submit", "broken", "--url", service.url, "--wait", "0")
        assert shown.returncode == 0 and "is filed" in shown.stdout


@pytest.mark.long("label_farm", reason="a service is killed and started again")
def test_a_killed_service_goes_on_where_it_stood(tmp_path):
    record(tmp_path, 1, 8)
    gate = Gate(tmp_path / "gate")
    service = Service(tmp_path, workers=2, seconds=0.0, gate=gate, FAST_MODEL_FAILS="-5.8").start()
    service.client().post("/api/submissions", {"session": "session-0", "by": "ann"})
    gate.let(2)
    service.wait(lambda state: state["submissions"][0]["labelled"] == 2)
    workers = service.children
    service.kill(signal.SIGKILL)
    deadline = time.monotonic() + 60
    while any(os.path.exists(f"/proc/{pid}/exe") for pid in workers):
        assert time.monotonic() < deadline, "workers end with their service"
        time.sleep(0.1)
    assert len(list((tmp_path / "farm").glob("??/*.npz"))) == 2
    gate.open()
    with service:
        service.wait(all_finished)
    with service:
        [entry] = service.client().get("/api/state")["submissions"]
        labelled = [k for k in range(8) if k != 4]
        assert entry["recent"] == labelled[::-1], "what was done before a restart is still shown"
        assert "no equilibrium" in entry["failures"]["4"]
        assert service.client().get("/api/submissions/000001/results") == {"labels": labelled, "failures": [4]}
    solves = (tmp_path / "solves.log").read_text().splitlines()
    assert len(list((tmp_path / "session-0" / "labels").glob("*.parquet"))) == 7
    assert len(solves) <= 8 + len(workers)


def test_a_worker_of_elsewhere_needs_the_token_and_the_same_code(tmp_path):
    record(tmp_path, 1, 4)
    arguments = ("--processes", "1", "--factory", "fast_model:FastModel")
    with Service(tmp_path, workers=0, options=("--token", TOKEN)) as service:
        client = service.client(TOKEN)
        client.post("/api/submissions", {"session": "session-0", "by": "ann"})
        assert ask(service, "/api/state")[0] == 401
        assert ask(service, "/api/state", Authorization="Bearer wrong")[0] == 401
        shown = verb("farm", "worker", service.url, "--token", "wrong")
        assert shown.returncode == 2 and "a wrong token" in shown.stderr
        with crew(service, *arguments, how=signal.SIGTERM, FAST_MODEL_VERSION="2") as other:
            deadline = time.monotonic() + 60
            while not (noted := [w["note"] for w in client.get("/api/state")["workers"] if w["note"]]):
                assert time.monotonic() < deadline
                time.sleep(0.2)
            assert "refuses model" in noted[0] and other.poll() is None
        state = client.get("/api/state")
        assert state["presses"]["solved"] == 0 and not state["workers"], "a worker that is asked to end takes its leave"
        with crew(service, *arguments):
            deadline = time.monotonic() + 60
            while not all_finished(state := client.get("/api/state")):
                assert time.monotonic() < deadline
                time.sleep(0.2)
        assert state["submissions"][0]["labelled"] == 4 and state["presses"]["solved"] == 4
        assert all(row["owner"].startswith("remote:") for row in state["workers"])


class crew:
    """`tacdata farm worker` as a process."""

    def __init__(self, service, *arguments, how=signal.SIGINT, **variables):
        self.how = how
        path = os.pathsep.join([str(HERE), str(ROOT)])
        command = [sys.executable, "-m", "tacdata.cli", "farm", "worker", service.url, *arguments]
        environment = {**os.environ, "PYTHONPATH": path, "TACDATA_FARM_TOKEN": TOKEN, **variables}
        self.process = subprocess.Popen(
            command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def __enter__(self):
        return self.process

    def __exit__(self, *_):
        self.process.send_signal(self.how)
        assert self.process.wait(60) == 128 + self.how


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--host", "0.0.0.0"), "without a token"),
        (("--token", "short"), "at least 16"),
        (("--host", "192.0.2.1", "--token", TOKEN), "cannot listen"),
        (("--root", "nowhere"), "no folder"),
        (("--device", ("gpu",)), "cuda for all GPUs"),
    ],
)
def test_what_may_not_be_served_is_said(tmp_path, monkeypatch, options, words):
    from tacdata.label_farm.service import up

    names = {"--host": "host", "--token": "token", "--root": "root", "--device": "devices"}
    given = {names[key]: value for key, value in zip(options[::2], options[1::2], strict=True)}
    root = tmp_path / given.pop("root", "")
    with pytest.raises(UsageError, match=words):
        up.up(up.UpSettings(root=root, port=0, **given))
