"""Run every test: what only computes beside what takes its time, where there is a second core.

Tests that drive devices and viewers are on the screen; the others' output follows when both are done.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests"
COMPUTE = (
    "benchmarks", "chain", "discrepancy", "effects", "indenters", "label_farm", "revision", "skin", "surrogate",
    "training",
)  # fmt: skip
"""Rooms that run beside the others."""
MOST_THREADS = 4
"""Tests are small: more threads of one would only wait for the other part's."""


def main() -> int:
    """Return the exit status of the first part that failed."""
    pytest, cores = [sys.executable, "-m", "pytest"], os.cpu_count() or 1
    if cores < 2:
        return _status(subprocess.run(pytest, check=False))
    environment = {**os.environ, "OMP_NUM_THREADS": str(min(cores // 2, MOST_THREADS))}
    rooms = [str(TESTS / name) for name in COMPUTE]
    with tempfile.TemporaryFile("w+") as said:
        other = subprocess.Popen(
            [*pytest, "-q", "-p", "no:cacheprovider", *rooms], stdout=said, stderr=subprocess.STDOUT, env=environment
        )
        try:
            own = subprocess.run([*pytest, *(f"--ignore={room}" for room in rooms)], env=environment, check=False)
            other.wait()
        finally:
            other.kill()
        said.seek(0)
        print(f"\nbeside them: {' '.join(COMPUTE)}\n{said.read()}", flush=True)
    return _status(own) or _status(other)


def _status(done: "subprocess.CompletedProcess | subprocess.Popen") -> int:
    """Return an exit status; a death without a word is told."""
    if done.returncode < 0:
        print(f"pytest was killed by signal {-done.returncode}", flush=True)
    return abs(done.returncode)


if __name__ == "__main__":
    sys.exit(main())
