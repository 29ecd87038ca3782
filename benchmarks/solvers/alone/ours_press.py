"""Solve a case with ``tacdata`` in a process of its own and take its times. Usage: ours_press.py CASE OUT."""

import json
import sys
import time
from itertools import pairwise
from pathlib import Path

import torch

from tacdata.cases.case import read_case, solve_case


def main(case: Path, out: Path) -> None:
    """Solve; write times.json next to the results. The first depth must be 0: it carries the cost of the start."""
    torch.set_num_threads(1)
    marks = [(time.perf_counter(), time.process_time())]
    solve_case(read_case(case), out, lambda depth: marks.append((time.perf_counter(), time.process_time())))
    times = [[b - a for a, b in zip(one, two, strict=True)] for one, two in pairwise(marks)]
    (out / "times.json").write_text(json.dumps(times) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
