"""How the farm starts a Python process: same interpreter, same packages, one thread."""

from __future__ import annotations

import os
import sys
from pathlib import Path

THREADS = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def python(module: str) -> list[str]:
    """Return the command that runs a module without putting the current folder on its path."""
    return [sys.executable, "-P", "-m", module]


def variables() -> dict[str, str]:
    """Return the environment: one thread per process, and the folder that this package was imported from."""
    root = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    return {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": path, "PYTHONUNBUFFERED": "1"}


def cores() -> int:
    """Return how many cores this process may use: its affinity, cut by the container's quota."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = Path("/sys/fs/cgroup/cpu.max")
    if quota.exists():
        share, period = quota.read_text().split()
        if share != "max":
            available = min(available, max(1, int(share) // int(period)))
    return available
