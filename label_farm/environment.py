"""How the farm starts a Python process: same interpreter, same packages, one thread."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tacdata.errors import UsageError

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


DEVICE = "TACDATA_DEVICE"
"""Variable that says where a process solves: "cpu" or a card such as "cuda:0"."""


def variables(device: str = "cpu") -> dict[str, str]:
    """Return the environment: one thread per process, the folder that this package was imported from, the device."""
    root = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    own = dict.fromkeys(THREADS, "1") | {"PYTHONPATH": path, "PYTHONUNBUFFERED": "1"}
    if device.startswith("cuda:"):
        # The process sees its own card alone, under the number 0.
        cards = list(filter(None, os.environ.get("CUDA_VISIBLE_DEVICES", "").split(",")))
        number = int(device.removeprefix("cuda:"))
        own |= {"CUDA_VISIBLE_DEVICES": cards[number] if number < len(cards) else str(number), DEVICE: "cuda:0"}
    else:
        own |= {DEVICE: device}
    return {**os.environ, **own}


def devices(asked: Sequence[str]) -> tuple[str, ...]:
    """Return what workers solve on: what was asked for, "cuda" standing for all cards of this machine; else "cpu".

    Raises:
        UsageError: If a name is neither, or "cuda" was asked for and the driver lists no card.
    """
    found: list[str] = []
    for name in asked or ("cpu",):
        there = _cards() if name == "cuda" else [name]
        if not there or not re.fullmatch(r"cpu|cuda:[0-9]+", there[0]):
            raise UsageError(
                f"the device {name!r}" + (", but nvidia-smi lists no card" if name == "cuda" else ""),
                "cpu, cuda for all cards, or cards such as cuda:0",
                "name another with --device",
            )
        found += there
    return tuple(found)


def _cards() -> list[str]:
    try:
        listed = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=20).stdout
    except (OSError, subprocess.SubprocessError):
        return []
    found = len([line for line in listed.splitlines() if line.startswith("GPU ")])
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    return [f"cuda:{k}" for k in range(found if visible is None else len(list(filter(None, visible.split(",")))))]


def cores() -> int:
    """Return how many cores this process may use: its affinity, cut by the container's quota."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = Path("/sys/fs/cgroup/cpu.max")
    if quota.exists():
        share, period = quota.read_text().split()
        if share != "max":
            available = min(available, max(1, int(share) // int(period)))
    return available
