"""Warp starts without a word about a card that is not there, and says everything else."""

import os
import shutil
import subprocess
import sys

import pytest
import warp as wp

from tacdata import warp_runtime

FAKE = """
import os, warp
said = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver. GPU\\nsomething else\\n"
warp.init = lambda: os.write(2, said)
warp.is_cuda_available = lambda: False
import tacdata.warp_runtime
"""


@pytest.mark.parametrize(
    ("code", "expected"), [(FAKE, "something else\n"), ("import tacdata.chain.memory_kernels", "")]
)
def test_start_says_nothing_of_a_missing_card(code, expected):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == expected


def test_long_loops_of_kernels_are_written_out_for_a_card_alone():
    assert (wp.config.max_unroll > warp_runtime.UNROLLED) == wp.is_cuda_available()


LOAD = """
from tacdata import warp_runtime
from tacdata.chain.memory_kernels import _filter
_filter.module.load("cpu", block_dim=1)
"""


def compiled(cache, kernels):
    """Load a kernel with an empty cache; return the object files there, with the times of their making."""
    places = {"WARP_CACHE_PATH": str(cache), "TACDATA_KERNELS": str(kernels)}
    subprocess.run([sys.executable, "-c", LOAD], env={**os.environ, **places}, check=True)
    return {path.name: path.stat().st_mtime_ns for path in cache.glob("*/wp_*/*.o")}


def test_a_kernel_built_ahead_is_not_compiled(tmp_path):
    # A machine that is of no such kind, or has a card, compiles for itself both times.
    kinds = [] if wp.is_cuda_available() else warp_runtime.processors()
    built = tmp_path / "kernels" / wp.__version__ / next(iter(kinds), "none")
    (built / "wp_other_0123456").mkdir(parents=True)
    first = compiled(tmp_path / "first", tmp_path / "kernels")
    assert len(first) == 1
    shutil.copytree(tmp_path / "first" / wp.__version__, built, dirs_exist_ok=True)
    second = compiled(tmp_path / "second", tmp_path / "kernels")
    assert (second == first) == bool(kinds)
