"""A month of presses in the simulated world, with one random fault an hour: does anything go wrong unseen?

    python benchmarks/month_of_presses.py --hours 720 --presses 8 --out month.jsonl

Each hour has a rig, a seed and a fault of its own; afterwards a person repairs the rig and resumes. A whole month has
`--presses 694` an hour, half a million in all, and takes some 60 hours of one core. With fewer presses an hour the
faults stay, and the quiet time between them is left out. `--first` goes on with a later hour, `--cores` shares them.

Printed: presses, hours of which an invariant of `tests/simulation/README.md` does not hold (a complete file that went
elsewhere than planned is one), the longest rest in the skin beyond the plan's hold, and runs that moved down while the
machine's count was wrong.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from unittest import mock

import numpy as np

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS / "simulation"), str(TESTS)]  # pyserial imports the lines by the folder's name

import drawn_faults  # noqa: E402
import simulated_run  # noqa: E402

SEED = 700_000
"""Seed of hour 0."""
COURSES = ("", "", "tools", "touch")
"""Courses that press: plain, with changes of the tool, with a touch before the first press."""
MOVED = 0.01
"""Way down that is a motion [mm]."""


def hour(presses: int, number: int) -> dict:
    """Play one hour; return its faults, what did not hold, and the figures of its runs."""
    runs, begin, broken = [], time.process_time(), simulated_run.broken

    def judged(run, faults):
        runs.append(_figures(run))
        yield from broken(run, faults)

    with mock.patch.multiple(simulated_run, broken=judged, COURSES=COURSES):
        try:
            names, found, seconds = simulated_run.play(SEED + number, tuple(drawn_faults.ALL), presses)
        except Exception as error:  # a fault of the world itself must not end the month
            names, found, seconds = [], [f"the world broke: {type(error).__name__}: {error}"], 0.0
    cost = round(time.process_time() - begin, 2)
    return {"hour": number, "names": names, "found": found, "runs": runs, "seconds": round(seconds, 1), "cpu": cost}


def _figures(run) -> dict:
    """Return the longest rest beyond the hold [s] and the way down while the machine's count was wrong [mm]."""
    rows = simulated_run.between(run.world.path, run.begin, run.end)
    down = np.maximum(-np.diff(rows[:, 3]), 0.0)[rows[:-1, 5] > 0].sum() if len(rows) else 0.0
    return {"rest": round(float(simulated_run.longest_rest(run)), 2), "down": round(float(down), 3)}


def table(rows: list[dict], presses: int) -> str:
    """Return the month in lines of text."""
    rests = [max((run["rest"] for run in row["runs"]), default=0.0) for row in rows]
    downs = sum(any(run["down"] > MOVED for run in row["runs"][1:]) for row in rows)
    kinds = Counter(name for row in rows for name in row["names"] if name in drawn_faults.ALL)
    return "\n".join(
        [
            f"hours                                    {len(rows)}, of {len(kinds)} kinds of fault",
            f"presses                                  {len(rows) * presses}",
            f"hours with a broken invariant            {sum(bool(row['found']) for row in rows)}",
            f"rests in the skin above 5 s              {sum(rest > simulated_run.WAIT for rest in rests)}",
            f"longest rest in the skin [s]             {max(rests, default=0.0):.1f}",
            f"resumed runs that moved down while lost  {downs}",
            f"simulated [h]                            {sum(row['seconds'] for row in rows) / 3600:.1f}",
            f"of a core [h]                            {sum(row['cpu'] for row in rows) / 3600:.2f}",
        ]
    )


def main() -> None:
    """Play the hours and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=int, default=720, help="hours with one fault each")
    parser.add_argument("--presses", type=int, default=8, help="presses an hour; 694 for the whole month")
    parser.add_argument("--first", type=int, default=0, help="number of the first hour")
    parser.add_argument("--cores", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, help="file that receives a line of JSON after each hour")
    options = parser.parse_args()
    rows, numbers = [], range(options.first, options.first + options.hours)
    with Pool(options.cores, maxtasksperchild=50) as pool:
        for row in pool.imap_unordered(partial(hour, options.presses), numbers):
            rows.append(row)
            if row["found"]:
                print(f"hour {row['hour']} ({', '.join(row['names'])}):", *row["found"], sep="\n  ", flush=True)
            if options.out:
                with options.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    print(table(rows, options.presses))


if __name__ == "__main__":
    main()
