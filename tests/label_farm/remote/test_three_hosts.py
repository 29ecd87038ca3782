"""Three hosts made of network namespaces: one loses power, another its network, and every label comes about once."""

import json
import os
import subprocess
import sys
import time

import hosts
import pytest
from chaos import ROOT, compare, record, undisturbed
from farm_examples import HERE
from gate import Gate

pytestmark = [
    pytest.mark.long("label_farm", reason="three hosts of one network: one dies, one is cut off and comes back"),
    pytest.mark.timeout(900),
    pytest.mark.skipif(not hosts.possible(), reason="this machine gives no network namespaces (root, iproute2)"),
]
TOKEN = "0123456789abcdef0123"
PRESSES = 48


def environment(**more):
    path = os.pathsep.join([str(HERE), str(ROOT)])
    return {**os.environ, "PYTHONPATH": path, "TACDATA_FARM_TOKEN": TOKEN, "OMP_NUM_THREADS": "1", **more}


def tacdata(*arguments):
    return [sys.executable, "-m", "tacdata.cli", *arguments]


def ask(network, url, path, document=None):
    """Ask the service from its own host: this test is in none of them."""
    script = (
        "import json, sys; from tacdata.label_farm.remote.client import Client; c = Client(sys.argv[1], sys.argv[2]);"
        "d = json.loads(sys.argv[4]); print(json.dumps(c.get(sys.argv[3]) if d is None else c.post(sys.argv[3], d)))"
    )
    line = ["ip", "netns", "exec", "tac-head", sys.executable, "-c", script, url, TOKEN, path, json.dumps(document)]
    shown = subprocess.run(line, capture_output=True, text=True, cwd=ROOT, env=environment())
    assert shown.returncode == 0, shown.stderr
    return json.loads(shown.stdout)


def wait(condition, seconds=240.0, every=0.5):
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(every)
    return found


@pytest.mark.parametrize("engine", ["dask", "http"])
def test_a_host_dies_and_another_loses_its_network(tmp_path, engine):
    if engine == "dask":
        pytest.importorskip("distributed")
    work, peace = tmp_path / "work", tmp_path / "peace"
    work.mkdir()
    peace.mkdir()
    names, gate = record(work, 1, PRESSES), Gate(tmp_path / "gate")
    with hosts.Hosts("head", "one", "two") as network, (tmp_path / "log").open("w") as log:
        head, said = network.address["head"], {"stdout": log, "stderr": log, "cwd": ROOT}
        scheduler, url = f"tcp://{head}:8786", f"http://{head}:8765"
        options, joined = ("--workers", "0"), url
        if engine == "dask":
            # A worker that is cut off is given up after 10 s; Dask's own default is 5 minutes.
            patience = environment(DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL="10s")
            line = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", head, "--no-dashboard"]
            network.start("head", line, env=patience, **said)
            options, joined = ("--dask", scheduler), scheduler
        log_of_solves = str(work / "solves.log")
        slow = environment(FAST_MODEL_SECONDS="0.5", FAST_MODEL_LOG=log_of_solves, **gate.variables)
        up = tacdata("farm", "up", "--root", str(work), "--host", head, "--factory", "fast_model:FastModel", *options)
        network.start("head", up, env=environment(), **said)

        def join(host):
            extra = () if engine == "dask" else ("--factory", "fast_model:FastModel")
            line = tacdata("farm", "worker", joined, "--processes", "1", *extra)
            return network.start(host, line, env=slow, **said)

        wait(lambda: "label farm of" in (tmp_path / "log").read_text())
        workers = {host: join(host) for host in ("one", "two")}
        ask(network, url, "/api/submissions", {"session": names[0], "by": "ann"})

        def labelled():
            return ask(network, url, "/api/submissions/000001")["labelled"]

        def both_worked():
            gate.let(2)
            rows = ask(network, url, "/api/state")["workers"]
            return all(any(row["done"] and f"{host}/" in row["owner"] for row in rows) for host in workers)

        wait(both_worked)
        network.kill(workers["one"])
        before = labelled()
        gate.let(6)
        wait(lambda: labelled() >= before + 4)
        network.cut("two")
        time.sleep(5.0)
        stuck = labelled()
        assert stuck < PRESSES, "there is work left when all hosts are gone"
        join("one")
        gate.open()
        wait(lambda: labelled() > stuck)
        network.mend("two")
        # Asking costs a process: seldom enough not to starve those that work.
        ended = wait(lambda: (e := ask(network, url, "/api/submissions/000001"))["state"] == "done" and e, 480.0, 3.0)
        assert (ended["labelled"], ended["failed"]) == (PRESSES, 0)
    undisturbed(peace, work, names)
    assert compare(work, peace, names, PRESSES) <= 12, "only what was in work on a lost host is solved again"
