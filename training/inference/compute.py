"""Where and how the arithmetic runs: the device, its threads, and the same bits every time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from threadpoolctl import threadpool_limits

from tacdata.errors import UsageError

THREADS = 4
"""Most CPU threads for a network this small; more only wait for each other."""


def choose_device(name: str) -> torch.device:
    """Return the device called ``name``: "auto" (CUDA if there is one), "cpu", "cuda" or "cuda:N".

    Raises:
        UsageError: If there is no such device here.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    count = torch.cuda.device_count()
    allowed = ["auto", "cpu", *(["cuda"] if count else []), *(f"cuda:{i}" for i in range(count))]
    if name not in allowed:
        raise UsageError(f"--device {name}", ", ".join(allowed), "choose one of them")
    return torch.device(name)


@contextmanager
def reproducible(threads: int | None = None) -> Iterator[None]:
    """Use deterministic algorithms and a fixed number of threads inside, and leave the process as it was.

    Args:
        threads: CPU threads; by default one for each core that this process may use, at most `THREADS`.
    """
    previous = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    # cuBLAS is deterministic only with a workspace of fixed size (cuBLAS manual, "Results reproducibility").
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    torch.set_num_threads(threads or min(len(os.sched_getaffinity(0)), THREADS))
    torch.use_deterministic_algorithms(True)
    try:
        # NumPy's own threads contend with torch's for the cores: a fit took a sixth longer.
        with threadpool_limits(1, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(previous[0])
        torch.use_deterministic_algorithms(previous[1])
