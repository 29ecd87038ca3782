"""Run every test: what drives devices, hosts and viewers by itself, then what only computes in two parts side by side.

Arguments go to every pytest.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests"
COMPUTE = (
    ("indenters", "skin"),
    ("benchmarks", "chain", "discrepancy", "effects", "revision", "surrogate", "training"),
)
"""Rooms of either part."""
MOST_THREADS = 4
"""Tests are small: more threads of one would only wait for those of the other part."""
PYTEST = [sys.executable, "-m", "pytest"]


def main(arguments: list[str]) -> int:
    """Return the exit status of the first part that failed."""
    parts = [[str(TESTS / name) for name in rooms] for rooms in COMPUTE]
    alone = subprocess.run(
        [*PYTEST, *arguments, *(f"--ignore={room}" for rooms in parts for room in rooms)], check=False
    )
    cores = os.cpu_count() or 1
    if cores < 2:
        rest = subprocess.run([*PYTEST, *arguments, *(room for rooms in parts for room in rooms)], check=False)
        return _status(alone) or _status(rest)
    environment = {**os.environ, "OMP_NUM_THREADS": str(min(cores // 2, MOST_THREADS))}
    with tempfile.TemporaryFile("w+") as said:
        second = subprocess.Popen(
            [*PYTEST, "-p", "no:cacheprovider", *arguments, *parts[1]], stdout=said, stderr=subprocess.STDOUT,
            env=environment,
        )  # fmt: skip
        try:
            first = subprocess.run([*PYTEST, *arguments, *parts[0]], env=environment, check=False)
            second.wait()
        finally:
            second.kill()
        said.seek(0)
        print(f"\nbeside them: {' '.join(COMPUTE[1])}\n{said.read()}", flush=True)
    return _status(alone) or _status(first) or _status(second)


def _status(done: "subprocess.CompletedProcess | subprocess.Popen") -> int:
    """Return an exit status; a death without a word is told."""
    if done.returncode < 0:
        print(f"pytest was killed by signal {-done.returncode}", flush=True)
    return abs(done.returncode)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
