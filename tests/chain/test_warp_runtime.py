"""Warp starts without a word about a card that is not there, and says everything else."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tacdata import warp_runtime
from tacdata.warp_runtime import wp

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


OPTIONS = """
import importlib, pkgutil, sys
import tacdata
from tacdata import warp_runtime
for room in ("chain", "skin", "surfaces"):
    package = importlib.import_module(f"tacdata.{room}")
    for _, name, _ in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if "import wp" in open(importlib.util.find_spec(name).origin).read():
            importlib.import_module(name)
wp = warp_runtime.wp
expected = wp.config.max_unroll if wp.is_cuda_available() else warp_runtime.UNROLLED
modules = [m for m in wp._src.context.user_modules.values() if not m.name.startswith("warp.")]
print(len(modules), [m.name for m in modules if m.options["max_unroll"] != expected])
"""


def test_long_loops_of_all_kernels_are_written_out_for_a_card_alone():
    assert (wp.config.max_unroll > warp_runtime.UNROLLED) == wp.is_cuda_available()
    done = subprocess.run([sys.executable, "-c", OPTIONS], capture_output=True, text=True, check=True)
    count, others = done.stdout.split(maxsplit=1)
    assert int(count) > 5 and others.strip() == "[]"


LOAD = """
from tacdata import warp_runtime
from tacdata.chain.memory_kernels import _filter
_filter.module.load("cpu", block_dim=1)
"""


REPORT = """
from tacdata import warp_runtime
from tacdata.chain.memory_kernels import _filter
with warp_runtime.report_modules(lambda *modules: print(*modules)):
    for _ in range(2):
        warp_runtime.load_kernels([_filter], "cpu")
_filter.module.unload()
warp_runtime.load_kernels([_filter], "cpu")
"""


def test_modules_are_reported_as_they_load():
    done = subprocess.run([sys.executable, "-c", REPORT], capture_output=True, text=True, check=True)
    expected = warp_runtime.MODULES["cuda" if wp.is_cuda_available() else "cpu"]
    assert (done.stdout, done.stderr) == (f"1 {expected}\n", "")


def compiled(cache, kernels):
    """Load a kernel with an empty cache; return the object files there, with the times of their making."""
    places = {"WARP_CACHE_PATH": str(cache), "TACDATA_KERNELS": str(kernels)}
    subprocess.run([sys.executable, "-c", LOAD], env={**os.environ, **places}, check=True)
    return {path.name: path.stat().st_mtime_ns for path in cache.glob("*/wp_*/*.o")}


def test_a_shipped_kernel_is_not_compiled(tmp_path):
    # A machine that is of no such kind, or has a card, compiles for itself both times.
    kinds = [] if wp.is_cuda_available() else warp_runtime.processors()
    built = tmp_path / "kernels" / wp.__version__ / next(iter(kinds), "none")
    (built / "wp_other_0123456").mkdir(parents=True)
    first = compiled(tmp_path / "first", tmp_path / "kernels")
    assert len(first) == 1
    shutil.copytree(tmp_path / "first" / wp.__version__, built, dirs_exist_ok=True)
    second = compiled(tmp_path / "second", tmp_path / "kernels")
    assert (second == first) == bool(kinds)


ASKED = """
import warp
warp.is_cuda_available = lambda: True
import tacdata.warp_runtime
"""
BUILT = """
from tacdata.warp_runtime import UNROLLED_ON_GPU, wp
wp.config.max_unroll = UNROLLED_ON_GPU
"""
PLAIN = "import tacdata.warp_runtime"
NAMES = """
import json, sys, warp as wp
from types import SimpleNamespace
from tacdata.indenters.sphere import Sphere
from tacdata.skin.derivatives.compilation import derivative_kernels
from tacdata.skin.materials import load_law
from tacdata.skin.solve.compilation import batch_kernels
from tacdata.skin.surface.depth_map_kernel import HIGHEST
from tacdata.skin.surface.pressed_shape import _laying_kernel
from tacdata.skin.validity.law_evaluation import _kernel
sphere = Sphere(1.0).distance_function()
skin, surface = (SimpleNamespace(averages=True, law="neo_hookean"),
    SimpleNamespace(distances={0.0: sphere}, flat=False, rough=True))
of_gpu = [*batch_kernels(skin, [surface]), *derivative_kernels(skin, [surface])]
of_cpu = [_laying_kernel(sphere), _kernel(type(load_law("neo_hookean")), wp.float64), HIGHEST["cpu"]]
[built] = wp.compile_aot_module(HIGHEST["cuda"].module, arch=90, module_dir=sys.argv[1])
print(json.dumps([built.name, sorted({kernel.module.get_module_identifier() for kernel in of_gpu}),
    [kernel.module.get_module_identifier(block_dim=1) for kernel in of_cpu]]))
"""


def test_modules_made_without_a_gpu_have_the_names_that_a_machine_with_one_asks_for(tmp_path):
    for kind in warp_runtime.processors():
        (tmp_path / "kernels" / wp.__version__ / kind).mkdir(parents=True)
    # A wheel's modules for GPUs are made where there is none, and without those for processors.
    names = {}
    for start, kernels in ((ASKED, "kernels"), (BUILT, "none"), (PLAIN, "kernels")):
        command = [sys.executable, "-c", start + NAMES, str(tmp_path / "built")]
        places = {"WARP_CACHE_PATH": str(tmp_path / "cache"), "TACDATA_KERNELS": str(tmp_path / kernels)}
        done = subprocess.run(command, env={**os.environ, **places}, capture_output=True, text=True, check=True)
        names[start] = json.loads(done.stdout.splitlines()[-1])
    asked, built, plain = names[ASKED], names[BUILT], names[PLAIN]
    assert asked[:2] == built[:2] and asked[0].endswith(".sm90.cubin") and len(asked[1]) > 20
    assert wp.is_cuda_available() or asked[2] == plain[2]
