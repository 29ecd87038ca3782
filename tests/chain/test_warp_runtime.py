"""Warp starts without a word about a card that is not there, and says everything else."""

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
