"""Workers and the service killed at random while they label; what is left must be as if nothing had happened."""

import hashlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import urllib.request
from collections import Counter
from contextlib import closing, suppress
from pathlib import Path

from farm_examples import HERE
from session_examples import session

from tacdata.errors import TacdataError
from tacdata.label_farm.remote.client import Client
from tacdata.label_farm.store import solution_file
from tacdata.labels import columns, read_label

ROOT = HERE.parent.parent
FINISHED = ("done", "refused", "cancelled")


class Service:
    """`tacdata farm up` with a stand-in model, as a process of its own."""

    def __init__(self, folder, workers=2, seconds=0.05, port=0, options=(), gate=None, **variables):
        self.folder, self.workers, self.options, self.port = folder, workers, options, port
        path = os.pathsep.join([str(HERE), str(ROOT)])
        self.environment = {
            **os.environ,
            "PYTHONPATH": path,
            "FAST_MODEL_SECONDS": str(seconds),
            "FAST_MODEL_LOG": str(folder / "solves.log"),
            "OMP_NUM_THREADS": "1",
            **(gate.variables if gate else {}),
            **variables,
        }
        self.process = None

    def start(self):
        command = [
            sys.executable,
            "-m",
            "tacdata.cli",
            "farm",
            "up",
            "--root",
            str(self.folder),
            "--port",
            str(self.port),
            "--workers",
            str(self.workers),
            "--factory",
            "fast_model:FastModel",
            *self.options,
        ]
        with (self.folder / "service.log").open("a") as log:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, text=True, env=self.environment, cwd=ROOT
            )
        for line in self.process.stdout:
            if " at http" in line:
                self.url = line.split(" at ")[1].strip()
                self.port = int(self.url.rpartition(":")[2])
                return self
        raise AssertionError(f"it did not start: {(self.folder / 'service.log').read_text()}")

    def kill(self, how=signal.SIGKILL):
        self.process.send_signal(how)
        self.process.wait()
        self.process.stdout.close()

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.kill(signal.SIGINT)

    @property
    def children(self):
        """Processes of the workers."""
        path = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        found = set()
        with suppress(FileNotFoundError):
            for task in path.parent.parent.iterdir():
                with suppress(FileNotFoundError):
                    found |= {int(pid) for pid in (task / "children").read_text().split()}
        return sorted(found)

    def client(self, token=""):
        return Client(self.url, token)

    def wait(self, condition, seconds=120.0):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            with suppress(TacdataError, OSError):
                if found := condition(self.client().get("/api/state")):
                    return found
            time.sleep(0.1)
        with urllib.request.urlopen(self.url + "/api/state") as answer:
            raise AssertionError(f"it did not happen: {json.load(answer)}")


def all_finished(state):
    return bool(state["submissions"]) and all(entry["state"] in FINISHED for entry in state["submissions"])


def record(folder, sessions, presses):
    """Record sessions of different presses; return their names."""
    names = [f"session-{k}" for k in range(sessions)]
    for k, name in enumerate(names):
        session(folder / name, presses, first=k * presses)
    return names


def torment(folder, names, jobs, kills, seed=1, seconds=0.1, service_share=0.2, limit=1800.0):
    """Label sessions while workers and the service are killed, spread over the whole work.

    One kill in six does not wait for its turn: it hits a start, a plan, or the worker that was just replaced.

    Returns:
        What was killed, how many presses were open at the last kill, and how long all of it took [s].
    """
    chance, killed, began = random.Random(seed), Counter(), time.monotonic()
    service = Service(folder, seconds=seconds).start()
    try:
        for name in names:
            service.client().post("/api/submissions", {"session": name, "by": "chaos"})
        while (count := sum(killed.values())) < kills:
            turn = 0 if chance.random() < 1 / 6 else (count + chance.random()) * 0.97 * jobs / kills
            while solved(folder) < turn:
                assert time.monotonic() - began < limit, killed
                time.sleep(0.01)
            time.sleep(chance.uniform(0.0, 2 * seconds))
            if chance.random() < service_share:
                service.kill()
                killed["service"] += 1
                service.start()
            elif children := service.children:
                with suppress(ProcessLookupError):
                    os.kill(chance.choice(children), signal.SIGKILL)
                    killed["worker"] += 1
            else:
                time.sleep(0.05)
        left = jobs - solved(folder)
        service.wait(all_finished, limit)
        states = service.client().get("/api/state")["submissions"]
    finally:
        service.__exit__()
    assert all(entry["state"] == "done" and not entry["failed"] for entry in states), states
    return killed, left, time.monotonic() - began


def solved(folder):
    """Number of presses that the ledger holds for done; nothing of the farm's own code asks for it."""
    with (
        suppress(sqlite3.OperationalError),
        closing(sqlite3.connect(f"file:{folder}/farm/ledger.sqlite?mode=ro", uri=True)) as db,
    ):
        return db.execute("SELECT count(*) FROM job WHERE state = 2").fetchone()[0]
    return 0


def undisturbed(folder, original, names):
    """Label copies of the sessions in peace."""
    for name in names:
        shutil.copytree(original / name, folder / name, ignore=shutil.ignore_patterns("labels"))
    with Service(folder, seconds=0.0) as service:
        for name in names:
            service.client().post("/api/submissions", {"session": name, "by": "peace"})
        service.wait(all_finished, 600.0)


def fingerprint(folder, names):
    """Hashes of every value of every label and result, by file; asserts that nothing else lies there."""
    found = {}
    for name in names:
        for path in sorted((folder / name / "labels").iterdir()):
            # What a killed writer left unfinished bears a hidden name, which nothing reads; it is swept after an hour.
            if path.name.startswith(("index.sqlite", ".episode-")):
                continue
            assert path.suffix == ".parquet", path
            label, digest = read_label(path), hashlib.sha256()
            for column in columns.present(label):
                digest.update(getattr(label, column).tobytes())
            found[f"{name}/{path.name}"] = digest.hexdigest()
    for path in sorted((folder / "farm").glob("??/*")):
        assert path.suffix == ".npz", path
        job, solution = solution_file.decode(path.read_bytes(), str(path))
        assert job.key == path.stem
        found[path.name] = hashlib.sha256(
            b"".join(getattr(solution, n).tobytes() for n in columns.PATH_REQUIRED)
        ).hexdigest()
    return found


def compare(chaotic, peaceful, names, presses):
    """Assert that both folders hold each label and result exactly once, bit for bit the same."""
    first, second = fingerprint(chaotic, names), fingerprint(peaceful, names)
    assert len(first) == 2 * len(names) * presses, len(first)
    assert first == second
    solves = Counter(line.split()[1] for line in (chaotic / "solves.log").read_text().splitlines())
    return sum(solves.values()) - len(names) * presses
