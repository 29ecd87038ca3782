"""The farm at size: time to plan 100,000 presses, to resume with a million labels, and memory over a long run.

Run ``python benchmarks/label_farm_scale.py [--plan 100000] [--stored 1000000] [--run 5000]``; one JSON line a figure.
Recordings are stand-ins of a few bytes that give one press each from memory: the cost of reading a real one is timed by
itself. Presses are solved by a stand-in that takes no time.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests" / "label_farm"))

import numpy as np
from farm_examples import press_episode

from tacdata import provenance
from tacdata.label_farm import environment
from tacdata.label_farm.labelling import Labelling
from tacdata.label_farm.labels.label_index import Known, LabelIndex, stamp
from tacdata.label_farm.labels.recall import skin_key
from tacdata.label_farm.settings import FarmSettings
from tacdata.label_farm.store.store import Store
from tacdata.recording.episode import Episode


def report(figure: str, value: float, unit: str, **conditions: object) -> None:
    """Print one figure."""
    print(json.dumps({"figure": figure, "value": round(value, 3), "unit": unit, **conditions}), flush=True)


def memory() -> float:
    """Return this process's memory [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


class Recordings:
    """A session of ``count`` different presses; each recording is a file of a few bytes."""

    def __init__(self, folder: Path, count: int) -> None:
        """Write the files."""
        folder.mkdir(exist_ok=True)
        self._one = press_episode(folder, 0)
        self.paths = {k: folder / f"episode-{k:06d}.mcap" for k in range(count)}
        for number, path in self.paths.items():
            path.write_bytes(b"%d" % number)

    def read(self, number: int) -> Episode:
        """Return an episode: the one press, moved."""
        one, x, y = self._one, 1e-3 * (number % 4000), 1e-3 * (number // 4000)
        tip = one.tip + np.array([x, y, 0.0])
        press = replace(one.press, index=number, x=x, y=y)
        return replace(one, path=self.paths[number], press=press, tip=tip)

    def readers(self) -> dict:
        """Return the functions that `Labelling` reads with."""
        return {number: (lambda number=number: self.read(number)) for number in self.paths}


def labelling(folder: Path, workers: int = 1) -> Labelling:
    """Return a run with the stand-in model."""
    settings = FarmSettings(factory="fast_model:FastModel", workers=workers)
    return Labelling(folder / "labels", Store(folder / "store"), settings)


def plan(folder: Path, count: int) -> None:
    """Time planning, and planning again after a kill."""
    recordings = Recordings(folder, count)
    for name in ("plan", "plan again, nothing solved"):
        run = labelling(folder)
        begin = time.perf_counter()
        run.plan(recordings.readers(), None, recordings.paths)
        report(name, time.perf_counter() - begin, "s", presses=count, wanted=run.pending, memory_MB=round(memory()))
        del run


def resume(folder: Path, count: int) -> None:
    """Time a run over a session whose labels are all there, by files that stand in for them."""
    folder.mkdir()
    (folder / "labels").mkdir()
    one = press_episode(folder, 0)
    run = labelling(folder)
    version = run._version(one.sensor)
    made = run._made(one.sensor, version)
    paths = {k: folder / f"episode-{k:06d}.mcap" for k in range(count)}
    key = skin_key(one.sensor)

    def rows() -> Iterator[Known]:
        for number, path in paths.items():
            label = run.labels.path(number)
            for file in (path, label):
                os.close(os.open(file, os.O_CREAT | os.O_WRONLY))
            yield Known(path.name, stamp(path), True, key, made, "0" * 64, "", stamp(label))

    begin = time.perf_counter()
    LabelIndex(folder / "labels").write(rows(), {key: one.sensor.document})
    report("write the stand-ins", time.perf_counter() - begin, "s", labels=count)
    run = labelling(folder)
    begin = time.perf_counter()
    summary = run.run({k: lambda: one for k in paths}, None, paths)
    assert len(summary.current) == count
    report("resume", time.perf_counter() - begin, "s", labels=count, memory_MB=round(memory()))


def long_run(folder: Path, count: int) -> None:
    """Watch memory while presses are solved and labels are written."""
    recordings = Recordings(folder, count)
    run, seen = labelling(folder, environment.cores()), []
    run._delivered = lambda *_: seen.append(memory()) if len(run.summary.written) % (count // 20) == 0 else None
    begin = time.perf_counter()
    run.run(recordings.readers(), None, recordings.paths)
    seconds = time.perf_counter() - begin
    report("labels", count / seconds, "labels/s", labels=count, workers=environment.cores())
    report("memory", seen[-1], "MB", after_a_quarter_MB=round(seen[len(seen) // 4], 1), highest_MB=round(max(seen), 1))


def main() -> None:
    """Run every part and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plan", type=int, default=100_000)
    parser.add_argument("--stored", type=int, default=1_000_000)
    parser.add_argument("--run", type=int, default=5_000)
    asked = parser.parse_args()
    os.environ["PYTHONPATH"] = sys.path[-1]
    report("machine", environment.cores(), "cores", python=platform.python_version(), code=provenance.code_version())
    for part, count in ((plan, asked.plan), (resume, asked.stored), (long_run, asked.run)):
        if count:
            with tempfile.TemporaryDirectory() as name:
                part(Path(name) / "session", count)


if __name__ == "__main__":
    main()
