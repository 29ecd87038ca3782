"""Cost of the first label of a session of two presses, and of both, with cold and with warm caches.

    python benchmarks/first_label.py [--runs 2]

`tacdata label` labels a copy of the recording that ships, with one worker of one thread. Every run of "cold" starts
with empty caches of kernels and answers. "shipped" does too, but has the kernels that a wheel ships for a kind of
processor (Linux on x86-64, no GPU). "warm" uses the caches that a cold run left. Phases are CPU seconds
of the processes of one run: the verb itself, the process that finds the model's version, the worker until its first
label and after it. The last lines give the ratios to cold, and whether all labels are equal bit by bit.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow.parquet as pq

import tacdata
from tacdata import warp_runtime
from tacdata.warp_runtime import wp

SESSION = Path(tacdata.__path__[0]) / "example" / "session"
PHASES = ("verb", "version", "first label", "other label")
_POLL = 0.25
"""Time between two looks [s]."""


def processes(root: int) -> dict[int, tuple[str, float]]:
    """Return command and CPU seconds of a process and those it started, by number (Linux)."""
    found, parents = {}, {root}
    ticks = os.sysconf("SC_CLK_TCK")
    for folder in sorted((path for path in Path("/proc").iterdir() if path.name.isdigit()), key=lambda p: int(p.name)):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
        number, parent = int(folder.name), int(fields[1])
        # A process that has ended and is not yet waited for has no command.
        if command and (number == root or parent in parents):
            parents.add(number)
            found[number] = (command, (int(fields[11]) + int(fields[12])) / ticks)
    return found


def label(session: Path, caches: Path, kernels: Path) -> dict[str, float]:
    """Label a copy of the session; return CPU seconds by phase."""
    shutil.copytree(SESSION, session, ignore=shutil.ignore_patterns("labels"))
    places = {"WARP_CACHE_PATH": caches / "warp", "TACDATA_CACHE": caches / "tacdata", "TACDATA_KERNELS": kernels}
    command = [sys.executable, "-m", "tacdata.cli", "label", str(session), "--workers", "1"]
    run = subprocess.Popen(
        command,
        env={**os.environ, "OMP_NUM_THREADS": "1", **{name: str(place) for name, place in places.items()}},
        stdout=subprocess.DEVNULL,
        text=True,
    )
    spent, first = dict.fromkeys(PHASES, 0.0), None
    while run.poll() is None:
        known = dict(spent)
        for command_line, seconds in processes(run.pid).values():
            if "workers.worker" in command_line:
                known["worker"] = seconds
            elif "presses.model" in command_line:
                known["version"] = max(known["version"], seconds)
            else:
                known["verb"] = max(known["verb"], seconds)
        if first is None and list((session / "labels").glob("episode-*.parquet")):
            first = known.get("worker", 0.0)
        worker = known.pop("worker", 0.0)
        spent = known
        if worker:
            spent["first label"] = first if first is not None else worker
            spent["other label"] = worker - spent["first label"]
        time.sleep(_POLL)
    if run.returncode:
        raise SystemExit(f"tacdata label ended with exit code {run.returncode}")
    return spent


def ship(place: Path) -> None:
    """Label once more, for a kind of processor, and keep the kernels as a wheel ships them."""
    shipped = place / "kernels" / wp.__version__ / warp_runtime.processors()[0]
    # While its folder is empty, kernels are compiled for it.
    shipped.mkdir(parents=True)
    label(place / "building session", place / "building", place / "kernels")
    shutil.copytree(place / "building" / "warp" / wp.__version__, shipped, dirs_exist_ok=True)


def values(session: Path) -> list[bytes]:
    """Return the numbers of a session's labels, without their provenance."""
    tables = [pq.read_table(path) for path in sorted((session / "labels").glob("episode-*.parquet"))]
    return [
        buffer.to_pybytes() for t in tables for c in t.columns for k in c.chunks for buffer in k.buffers() if buffer
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2)
    arguments = parser.parse_args()
    figures: dict[str, list[dict[str, float]]] = {"cold": [], "shipped": [], "warm": []}
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.runs):
            place = Path(folder) / str(number)
            for kind, runs in figures.items():
                caches = place / ("shipped" if kind == "shipped" else "cold")
                if kind == "shipped":
                    ship(place)
                runs.append(label(place / f"{kind} session", caches, place / "kernels"))
                found.append(values(place / f"{kind} session"))
    print(f"CPU s, medians of {arguments.runs} runs")
    print("caches  " + "".join(f"{phase:>13}" for phase in (*PHASES, "until first", "total")))
    totals = {}
    for kind, runs in figures.items():
        phases = [statistics.median(run[phase] for run in runs) for phase in PHASES]
        totals[kind] = (sum(phases[:-1]), sum(phases))
        print(f"{kind:8}" + "".join(f"{value:13.2f}" for value in (*phases, *totals[kind])))
    for kind in ("shipped", "warm"):
        until_first, total = (part / cold for part, cold in zip(totals[kind], totals["cold"], strict=True))
        print(f"{kind} over cold: {until_first:.2f} until the first label, {total:.2f} in all")
    print("labels: " + ("equal to the last bit" if all(each == found[0] for each in found) else "not equal"))


if __name__ == "__main__":
    main()
