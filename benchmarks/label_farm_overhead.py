"""Cost of the farm in addition to the solves: the queue, the store, and a run with a model that takes no time.

Run ``python benchmarks/label_farm_overhead.py [--jobs 2000] [--workers 1 2]``; one JSON line a figure.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tacdata import provenance
from tacdata.label_farm import environment
from tacdata.label_farm.ledger.ledger import Ledger
from tacdata.label_farm.presses.interpolate import Branch
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.pool import Pool
from tacdata.labels import PathSolution
from tacdata.sensor import Sensor, default_sensor


class InstantModel:
    """A model that answers at once with a path of the right shape."""

    def __init__(self, sensor: Sensor) -> None:
        """Keep the sensor."""
        self.sensor, self.content_hash = sensor, provenance.content_hash(["instant", sensor.content_hash])

    def solve(self, job: Job) -> PathSolution:
        """Return a surface proportional to the depth."""
        return instant_path(self.sensor, job.depths)


def instant_path(sensor: Sensor, depths: tuple[float, ...]) -> PathSolution:
    """Return a path whose surface is the depth times a random map."""
    depth = np.array(depths)
    surface = depth[:, None, None] * np.random.default_rng(1).random(sensor.map.shape)
    taxels = depth[:, None] * np.ones(sensor.taxels.count)
    zero = np.zeros(len(depth))
    return PathSolution(
        depth=depth,
        surface=surface,
        numerical=np.zeros_like(surface),
        taxel_force=taxels,
        taxel_force_error=taxels,
        taxel_closure=taxels,
        taxel_area=taxels,
        force=depth[:, None] * np.ones(3),
        force_error=zero,
        residual=zero,
        penetration=zero,
        provenance={},
    )


def jobs(count: int, model: str, sensor: Sensor) -> list[Job]:
    """Return jobs at ``count`` places."""
    depths = Ladder().depths(1.5)
    indenter = {"shape": "sphere", "radius": 2.0}
    return [Job(sensor.content_hash, model, indenter, k * 1e-4, 0.0, 0.0, depths) for k in range(count)]


def report(figure: str, value: float, unit: str, **conditions: object) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, "value": round(value, 3), "unit": unit, **conditions}), flush=True)


def ledger(folder: Path, wanted: list[Job]) -> None:
    """Time the queue alone, one worker."""
    with Ledger(folder / "ledger.sqlite") as queue:
        begin = time.perf_counter()
        queue.enqueue(wanted)
        report("enqueue", len(wanted) / (time.perf_counter() - begin), "jobs/s", jobs=len(wanted))
        begin = time.perf_counter()
        queue.enqueue(wanted)
        report("enqueue again", len(wanted) / (time.perf_counter() - begin), "jobs/s", jobs=len(wanted))
        begin = time.perf_counter()
        for _ in wanted:
            (lease,) = queue.claim("worker", lease_model(wanted))
            queue.finish(lease.job.key, "worker", 0.0)
        report("claim and finish", len(wanted) / (time.perf_counter() - begin), "jobs/s", jobs=len(wanted))


def lease_model(wanted: list[Job]) -> str:
    """Return the model version of the jobs."""
    return wanted[0].model


def results(folder: Path, wanted: list[Job], sensor: Sensor) -> None:
    """Time the store and the interpolation, on at most 200 results."""
    store, some = Store(folder / "results"), wanted[:200]
    solution = instant_path(sensor, some[0].depths)
    begin = time.perf_counter()
    for job in some:
        store.put(job, solution, sensor)
    size = store.path(some[0].key).stat().st_size
    report("store a result", 1e3 * (time.perf_counter() - begin) / len(some), "ms", bytes=size)
    begin = time.perf_counter()
    for job in some:
        store.intact(job)
    report("check a result", 1e3 * (time.perf_counter() - begin) / len(some), "ms")
    frames = np.linspace(0.01, 1.5, 300)
    branch = Branch.of(solution, "surface", True)
    branch.at(frames[:1])  # scipy is imported when it is needed first
    begin = time.perf_counter()
    branch.at(frames), branch.bound(frames)
    report("interpolate a frame", 1e6 * (time.perf_counter() - begin) / len(frames), "us", frames=len(frames))


def run(folder: Path, wanted: list[Job], sensor: Sensor, workers: int) -> None:
    """Time workers on jobs that take no time: all of it is overhead."""
    store = Store(folder / f"run-{workers}")
    with Ledger(store.ledger_path) as queue:
        queue.enqueue(wanted)
    # This file is run as a script; the workers find it as a module.
    pool = Pool(store, f"{Path(__file__).stem}:InstantModel", {lease_model(wanted): sensor}, workers)
    begin, first = time.perf_counter(), []
    pool.run({job.key for job in wanted}, 0, lambda change: first.append(time.perf_counter()))
    pool.close()
    steady = (first[-1] - first[0]) / (len(first) - 1)
    report("start of workers", first[0] - begin, "s", workers=workers)
    report("overhead a job", 1e3 * steady * workers, "ms of a worker", workers=workers, jobs=len(wanted))
    report("jobs", 1 / steady, "jobs/s", workers=workers, jobs=len(wanted))


def main() -> None:
    """Run every part and print its figures."""
    import os

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--workers", type=int, nargs="*", default=[1, environment.cores()])
    asked = parser.parse_args()
    os.environ["PYTHONPATH"] = str(Path(__file__).resolve().parent)
    sensor = default_sensor()
    report("machine", environment.cores(), "cores", python=platform.python_version(), code=provenance.code_version())
    wanted = jobs(asked.jobs, InstantModel(sensor).content_hash, sensor)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ledger(folder, wanted)
        results(folder, wanted, sensor)
        for workers in sorted(set(asked.workers)):
            run(folder, wanted, sensor, workers)


if __name__ == "__main__":
    sys.exit(main())
