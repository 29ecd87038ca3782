"""Starts Warp without its banner and without its warning that there is no GPU; the one place that imports it.

A file of kernels imports ``wp`` from here, as Warp's options are taken when a file's first kernel is declared. Compiled
kernels that a wheel ships are taken into Warp's cache first.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import warp as wp  # noqa: TID251
from warp import Function  # noqa: TID251

__all__ = ["ON_CPU", "Function", "load_kernels", "report_modules", "start", "wp"]

NO_GPU = b"Could not find or load the NVIDIA CUDA driver"
"""Printed by Warp's native library, past Python, at every start on a machine without a GPU."""
UNROLLED = 3
"""Passes up to which a kernel's loop is written out, on a machine without a GPU.

Kernels loop over an element's four points, ten nodes and three directions. Written out, as by Warp's 16, such loops run
as fast and take longer to compile, in Python and in LLVM. On an empty cache, `pytest
tests/skin/elasticity/test_skin_elasticity.py` takes 28 s of the processor, and 37 with 6 passes.
"""

ON_CPU: dict[str, Any] = {"max_unroll": UNROLLED}
"""Options of a module that runs on the CPU on every machine: one with a GPU, too, then takes that of a wheel."""

MODULES = {"cpu": 29, "cuda": 37}
"""Modules of kernels that the shipped session's first label takes, by kind of device: others take about as many."""

TOGETHER = 8
"""Modules that are compiled at a time where many are known to be needed."""

KERNELS = "TACDATA_KERNELS"
"""Variable with the folder of shipped kernels; by default that in this package."""
_SINCE_2013 = {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
PROCESSORS = {
    "x86-64-v4": _SINCE_2013 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
    "x86-64-v3": _SINCE_2013,
}
"""LLVM's name of a kind of processor -> its features, as Linux names them.

Objects for a kind serve every machine of that kind. Those for Warp's default, the machine's own processor, do not.
"""

GPUS = "gpus"
"""Folder of modules for GPUs, among those of kinds of processors."""
UNROLLED_ON_GPU = wp.config.max_unroll
"""Passes up to which a kernel's loop is written out for a GPU: Warp's own number."""


def start() -> None:
    """Start Warp; all other output of its native library is passed on."""
    _start_quietly()
    # A thread has one index. By Warp's default it loops, for grids of fewer threads than indices; here there are none.
    wp.config.default_grid_stride = False
    if wp.is_cuda_available():
        copy_to_cache(shipped_kernels() / wp.__version__ / GPUS)
    else:
        wp.config.max_unroll = UNROLLED
    # The newest kind first: objects for an older one would waste its wide registers.
    for processor in processors():
        shipped = shipped_kernels() / wp.__version__ / processor
        if shipped.is_dir() and wp.config.cpu_compiler_flags:
            flags = wp.config.cpu_compiler_flags
            ON_CPU["cpu_compiler_flags"] = flags.replace("-march=native", f"-target-cpu {processor}")
            if not wp.is_cuda_available():  # they are part of the names of modules for GPUs
                wp.config.cpu_compiler_flags = ON_CPU["cpu_compiler_flags"]
            copy_to_cache(shipped)
            break


@contextmanager
def report_modules(loaded: Callable[[int, int], None]) -> Iterator[None]:
    """Report modules of kernels as they are compiled or loaded: the number so far, and of all, after each."""
    logger, level = wp.get_logger(), wp.config.log_level
    wp.set_logger(_ModuleCount(loaded))
    wp.config.log_level = wp.LOG_INFO
    try:
        yield
    finally:
        wp.set_logger(logger)
        wp.config.log_level = level


def load_kernels(kernels: Iterable[wp.Kernel], device: str) -> None:
    """Compile or load kernels side by side, by a few threads: one after another they keep the first press waiting."""
    some = list({kernel.module for kernel in kernels})
    for start in range(0, len(some), TOGETHER):
        wp.force_load(device, some[start : start + TOGETHER], max_workers=TOGETHER)
        if isinstance(logger := wp.get_logger(), _ModuleCount):
            logger.report()


class _ModuleCount:
    """Warp's logger: counts the modules it names, and is silent as `start` has made Warp."""

    def __init__(self, loaded: Callable[[int, int], None]) -> None:
        self._loaded, self._count, self._reported = loaded, 0, 0
        self._about = MODULES["cuda" if wp.is_cuda_available() else "cpu"]

    def info(self, message: str) -> None:
        if message.lstrip().startswith("Module ") and " load on device " in message:
            self._count += 1
            # Whoever listens may not be called from another thread, such as those of `load_kernels`.
            if threading.current_thread() is threading.main_thread():
                self.report()

    def report(self) -> None:
        if self._count > self._reported:
            self._reported = self._count
            self._loaded(self._count, max(self._about, self._count))

    def debug(self, message: str) -> None: ...

    def warning(self, message: str, category: type[Warning] | None = None, stacklevel: int = 1) -> None: ...

    def error(self, message: str) -> None:
        sys.stderr.write(f"Warp Error: {message}\n")


def shipped_kernels() -> Path:
    """Return the folder of shipped kernels (`tacdata.label_farm.presses.kernels`), which need not exist.

    In it there is a folder for each release of Warp, and in that one for each kind of processor, and for GPUs.
    """
    return Path(os.environ.get(KERNELS) or Path(__file__).with_name("kernels"))


def copy_to_cache(folder: Path) -> None:
    """Copy compiled modules that Warp's cache lacks into it.

    A module's name has the hash of its source and of Warp's options: one of other source is never looked up.
    """
    cache = wp.config.kernel_cache_dir
    if cache is None:
        return
    for module in folder.glob("wp_*"):
        place = Path(cache) / module.name
        # A cache that cannot be written costs time alone. Of two processes the first to rename fills the place.
        with suppress(OSError):
            if not place.exists():
                copy = place.with_name(f"{place.name}_{uuid.uuid4().hex}")
                try:
                    shutil.copytree(module, copy)
                    copy.rename(place)
                finally:
                    shutil.rmtree(copy, ignore_errors=True)


def processors() -> list[str]:
    """Return those of `PROCESSORS` that this machine is; none but under Linux on x86-64."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
    features = {name for line in lines if line.startswith("flags") for name in line.partition(":")[2].split()}
    return [name for name, needed in PROCESSORS.items() if features >= needed]


def _start_quietly() -> None:
    wp.config.log_level = wp.LOG_ERROR
    if sys.stderr is None:  # a service without one
        wp.init()
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile() as printed:
        descriptor = os.dup(2)
        os.dup2(printed.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(descriptor, 2)
            os.close(descriptor)
            printed.seek(0)
            lines = [line for line in printed.read().splitlines(keepends=True) if NO_GPU not in line]
            # All other words of the library are passed on.
            os.write(2, b"".join(lines))


start()
