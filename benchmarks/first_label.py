"""Cost of the first label of a session of two presses, and of both, with cold and with warm caches.

    python benchmarks/first_label.py [--runs 2]

`tacdata label` labels a copy of the recording that ships, with one worker of one thread. Every run of "cold" starts
with empty caches of kernels and answers; "warm" uses those that a cold one left. Phases are CPU seconds of the
processes of one run: the verb itself, the process that finds the model's version, the worker until its first label
and after it. The last line gives warm over cold.
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

import tacdata

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


def label(folder: Path, caches: Path) -> dict[str, float]:
    """Label a copy of the session; return CPU seconds by phase."""
    session = folder / "session"
    shutil.rmtree(session, ignore_errors=True)
    shutil.copytree(SESSION, session, ignore=shutil.ignore_patterns("labels"))
    places = {"WARP_CACHE_PATH": str(caches / "warp"), "TACDATA_CACHE": str(caches / "tacdata")}
    command = [sys.executable, "-m", "tacdata.cli", "label", str(session), "--workers", "1"]
    run = subprocess.Popen(
        command, env={**os.environ, "OMP_NUM_THREADS": "1", **places}, stdout=subprocess.DEVNULL, text=True
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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2)
    arguments = parser.parse_args()
    figures: dict[str, list[dict[str, float]]] = {"cold": [], "warm": []}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.runs):
            caches = Path(folder) / f"caches {number}"
            for kind in figures:
                figures[kind].append(label(Path(folder), caches))
    print(f"CPU s, medians of {arguments.runs} runs")
    print("caches  " + "".join(f"{phase:>13}" for phase in (*PHASES, "until first", "total")))
    totals = {}
    for kind, runs in figures.items():
        phases = [statistics.median(run[phase] for run in runs) for phase in PHASES]
        totals[kind] = (sum(phases[:-1]), sum(phases))
        print(f"{kind:8}" + "".join(f"{value:13.2f}" for value in (*phases, *totals[kind])))
    until_first, total = (warm / cold for warm, cold in zip(totals["warm"], totals["cold"], strict=True))
    print(f"warm over cold: {until_first:.2f} until the first label, {total:.2f} in all")


if __name__ == "__main__":
    main()
