"""Environment of the farm's Python processes: same interpreter, same packages, one thread."""

from __future__ import annotations

import ctypes
import os
import re
import signal
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
"""Variable with the device of a process: "cpu" or a GPU such as "cuda:0"."""


def variables(device: str = "cpu") -> dict[str, str]:
    """Return the environment: one thread per process, the folder that this package was imported from, the device."""
    root = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    environment = dict.fromkeys(THREADS, "1") | {"PYTHONPATH": path, "PYTHONUNBUFFERED": "1"}
    if device.startswith("cuda:"):
        # The process sees its own GPU alone, under the number 0.
        gpus = list(filter(None, os.environ.get("CUDA_VISIBLE_DEVICES", "").split(",")))
        number = int(device.removeprefix("cuda:"))
        environment |= {"CUDA_VISIBLE_DEVICES": gpus[number] if number < len(gpus) else str(number), DEVICE: "cuda:0"}
    else:
        environment |= {DEVICE: device}
    return {**os.environ, **environment}


def devices(requested: Sequence[str]) -> tuple[str, ...]:
    """Return the devices of the workers: those requested, "cuda" for all GPUs of this machine; else "cpu".

    Raises:
        UsageError: If a name is neither, or a GPU is not there.
    """
    names: list[str] = []
    for name in requested or ("cpu",):
        gpus = [] if name == "cpu" else _gpus()
        available = gpus if name == "cuda" else [name]
        if (
            not available
            or not re.fullmatch(r"cpu|cuda:[0-9]+", available[0])
            or (name != "cpu" and available[0] not in gpus)
        ):
            inventory = f"this machine has {', '.join(gpus) or 'no CUDA GPU'}"
            raise UsageError(
                f"the device {name!r}; {inventory}",
                "cpu, cuda for all GPUs, or GPUs such as cuda:0",
                "name another with --device" if gpus else "leave --device out, or see that nvidia-smi -L lists a GPU",
            )
        names += available
    return tuple(names)


def idle_gpus(requested: Sequence[str]) -> str:
    """Return in words that this machine has GPUs and no device was chosen; "" otherwise."""
    count = 0 if requested else len(_gpus())
    named = "1 CUDA GPU lies" if count == 1 else f"{count} CUDA GPUs lie"
    return f"{named} idle here: --device cuda solves on all of them" if count else ""


def _gpus() -> list[str]:
    gpus = _listed() or _counted()
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    if visible is not None:
        gpus = min(gpus, len(list(filter(None, visible.split(",")))))
    return [f"cuda:{k}" for k in range(gpus)]


def _listed() -> int:
    try:
        listed = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=20).stdout
    except (OSError, subprocess.SubprocessError):
        return 0
    return len([line for line in listed.splitlines() if line.startswith("GPU ")])


def _counted() -> int:
    """Return how many GPUs the driver's library counts: some containers lack nvidia-smi."""
    count = ctypes.c_int(0)
    try:
        driver = ctypes.CDLL("libcuda.so.1")
        working = driver.cuInit(0) == 0 and driver.cuDeviceGetCount(ctypes.byref(count)) == 0
    except (OSError, AttributeError):
        return 0
    return count.value if working else 0


def end_on_terminate() -> None:
    """Let a request to end (SIGTERM: a batch system, a service manager) run the clean-up at the end."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))


def cores() -> int:
    """Return how many cores this process may use: its affinity, cut by the container's quota."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = Path("/sys/fs/cgroup/cpu.max")
    if quota.exists():
        share, period = quota.read_text().split()
        if share != "max":
            available = min(available, max(1, int(share) // int(period)))
    return available
