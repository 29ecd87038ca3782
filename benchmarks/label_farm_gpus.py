"""How the farm's rate grows with the cards of one machine: one worker a card, finite-element presses of one mesh.

Run ``python benchmarks/label_farm_gpus.py [--each 256] [--depth 1.0]``; one JSON line a figure. With n cards, n times
``--each`` different presses are queued at once for n workers that are warm already (kernels compiled, model built), and
the clock runs until the last is in the store: tails of batches, the queue and the disk are in it. The efficiency is the
rate of n cards over n times the rate of one. Presses are solved as by ``tacdata label --no-uncertainty``.

Needs no more than the skin model and the farm do: warp, torch, cholespy, numpy, scipy, trimesh, pyarrow, jsonschema,
pyyaml.
``--device cpu`` (once a worker) tries the script where there is no card; ``--factory fast_model:FastModel`` with
``PYTHONPATH=tests/label_farm`` tries it without the skin model.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from tacdata import provenance
from tacdata.errors import TacdataError, UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.ledger.ledger import FAILED, Ledger
from tacdata.label_farm.ledger.roster import Roster
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.label_farm.store.store import Store
from tacdata.label_farm.workers.pool import Pool
from tacdata.sensor import Sensor, default_sensor

REACH = (4.5, 2.5)
"""Presses lie within these distances of the pad's centre along x and y [mm]."""
POLL_SECONDS = 0.02
WARM_SECONDS = 480.0
"""How long workers may take to start, to compile and to solve their first press [s]."""


def report(figure: str, value: float, unit: str, **conditions: object) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, "value": round(value, 3), "unit": unit, **conditions}), flush=True)


class Presses:
    """An endless supply of different presses of one sensor."""

    def __init__(self, sensor: Sensor, version: str, depth: float) -> None:
        """Prepare; ``depth`` in mm."""
        self._sensor, self._version, self._depths = sensor, version, Ladder().depths(depth)
        self._random, self._radius = np.random.default_rng(0), self._radii()

    def many(self, count: int) -> list[Job]:
        """Return presses that may share a batch."""
        return [self._press(2.0) for _ in range(count)]

    def pair(self) -> list[Job]:
        """Return two presses that share a batch with no other, so that every worker gets a batch of its own."""
        radius = next(self._radius)
        return [self._press(radius), self._press(radius)]

    def _press(self, radius: float) -> Job:
        x, y = self._random.uniform(-1, 1, 2) * REACH
        indenter = {"shape": "sphere", "radius": radius}
        place = (round(float(x), 3), round(float(y), 3))
        job = Job(self._sensor.content_hash, self._version, indenter, *place, 0.0, self._depths, Ladder().tolerance)
        return job

    @staticmethod
    def _radii() -> Iterator[float]:
        radius = 2.0
        while True:
            radius = round(radius + 0.001, 3)
            yield radius


class Race:
    """Workers on some devices, with a store of their own."""

    def __init__(self, folder: Path, factory: str, sensor: Sensor, version: str, devices: list[str]) -> None:
        """Start nothing yet."""
        self._store, self._count = Store(folder), len(devices)
        self._pool = Pool(self._store, factory, {version: sensor}, len(devices), devices=devices)
        self._ledger = Ledger(self._store.ledger_path)
        self._roster = Roster(self._ledger)

    def warm(self, presses: Presses) -> float:
        """Let every worker solve presses; return how long that took [s].

        Raises:
            SolveError: If workers keep dying.
            UsageError: If they take longer than any should.
        """
        began = time.perf_counter()
        while sum(row.done > 0 for row in self._roster.listing()) < self._count:
            if self._ledger.unsettled(2 * self._count) < 2 * self._count:
                self._ledger.enqueue(presses.pair())
            if time.perf_counter() - began > WARM_SECONDS or self._ledger.counts()[FAILED]:
                raise UsageError(
                    f"after {time.perf_counter() - began:.0f} s not every worker has solved a press: "
                    f"{[change.error for change in self._ledger.changes(0) if not change.done] or 'no failure'}",
                    "workers that solve a press each",
                    "see the reason above",
                )
            self._turn()
        self._wait()
        return time.perf_counter() - began

    def run(self, jobs: list[Job]) -> float:
        """Solve jobs; return how long that took [s]."""
        began = time.perf_counter()
        self._ledger.enqueue(jobs)
        self._wait()
        return time.perf_counter() - began

    def failures(self) -> int:
        """Return how many presses have no result."""
        return self._ledger.counts()[FAILED]

    def close(self) -> None:
        """Stop the workers."""
        self._pool.close()
        self._ledger.close()

    def _wait(self) -> None:
        while self._ledger.unsettled(1):
            self._turn()

    def _turn(self) -> None:
        self._pool.tend(self._count)
        time.sleep(POLL_SECONDS)


def main() -> int:
    """Run with 1, 2, ... cards and print figures; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=256, help="presses a card")
    parser.add_argument("--depth", type=float, default=1.0, help="of every press [mm]")
    parser.add_argument("--device", action="append", help="cuda:0, cuda:1, ...; else all cards; repeatable")
    parser.add_argument("--counts", type=int, nargs="*", help="how many of them to use, one after the other; else all")
    parser.add_argument("--factory", default=model.FACTORY, help="what builds the model")
    asked = parser.parse_args()
    try:
        devices = list(environment.devices(asked.device or ["cuda"]))
        compare(asked, devices)
    except TacdataError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    return 0


def compare(asked: argparse.Namespace, devices: list[str]) -> None:
    """Run with each number of cards and print the figures."""
    sensor = replace(default_sensor(), uncertainty={})
    version = model.version(asked.factory, sensor).content_hash
    presses, single = Presses(sensor, version, asked.depth), 0.0
    report(
        "machine",
        len(devices),
        "devices",
        devices=devices,
        cores=environment.cores(),
        python=platform.python_version(),
        code=provenance.code_version(),
        model=version[:12],
    )
    for count in asked.counts or range(1, len(devices) + 1):
        with tempfile.TemporaryDirectory() as name:
            race = Race(Path(name) / "store", asked.factory, sensor, version, devices[:count])
            try:
                warm, seconds = race.warm(presses), race.run(presses.many(asked.each * count))
                failed = race.failures()
            finally:
                race.close()
        rate = asked.each * count / seconds
        single = single or rate / count
        report(
            "labels",
            rate,
            "labels/s",
            devices=count,
            labels=asked.each * count,
            failed=failed,
            seconds=round(seconds, 1),
            warm_seconds=round(warm, 1),
            efficiency=round(rate / (count * single), 3),
        )


if __name__ == "__main__":
    sys.exit(main())
