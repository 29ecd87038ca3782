"""Compiles the kernels of labels for a wheel: ``python -m tacdata.label_farm.presses.kernels [FOLDER]``.

Each shape is pressed once into the default skin, with an empty cache. The compiled modules go into a folder, by default
the one that a wheel ships (`tacdata.warp_runtime`). Every kind of processor that this machine is gets its own: some
minutes each. Warp compiles for GPUs without one, so nothing is pressed there.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tacdata import registry
from tacdata.indenters import Indenter
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.job import Job
from tacdata.sensor import default_sensor

_DEPTHS = (0.0, 0.05, 0.0)
"""Depths of the presses [mm]: down and up, as kernels care for no more."""

_KEPT = ("*.o", "*.cubin", "*.meta")
"""Files of a module that Warp reads."""

ARCHITECTURES = (80, 86, 89, 90, 100)
"""GPUs that get modules, by compute capability times ten: those of laboratories since 2020."""

_PRESS = "from tacdata.label_farm.presses.kernels import press_all; press_all()"
_COMPILE = "from tacdata.label_farm.presses.kernels import compile_all; compile_all({folder!r})"


def build(folder: Path) -> None:
    """Replace the modules of Warp's release in a folder by those of all shapes."""
    from tacdata.warp_runtime import GPUS, KERNELS, processors, wp

    shutil.rmtree(folder / wp.__version__, ignore_errors=True)
    for kind in (*processors(), GPUS):
        with tempfile.TemporaryDirectory() as empty:
            # An empty folder of a kind of processor makes Warp compile for it.
            (Path(empty) / "kernels" / wp.__version__ / kind).mkdir(parents=True)
            places = {"WARP_CACHE_PATH": f"{empty}/cache", KERNELS: f"{empty}/kernels"}
            code = _COMPILE.format(folder=f"{empty}/cache/{GPUS}") if kind == GPUS else _PRESS
            subprocess.run([sys.executable, "-c", code], env={**os.environ, **places}, check=True)
            for module in sorted(Path(empty, "cache").glob(f"{GPUS}/wp_*" if kind == GPUS else "*/wp_*")):
                place = folder / wp.__version__ / kind / module.name
                place.mkdir(parents=True)
                for file in (file for pattern in _KEPT for file in module.glob(pattern)):
                    shutil.copy(file, place)


def press_all() -> None:
    """Press every shape that ships."""
    sensor = default_sensor()
    solver = model.build(model.FACTORY, sensor)
    jobs = [Job(sensor.content_hash, solver.content_hash, s.document, 0.0, 0.0, 0.0, _DEPTHS) for s in _shapes()]
    for job, outcome in model.solve_each(solver, jobs):
        print(job.indenter["shape"], outcome if isinstance(outcome, Exception) else "pressed")


def compile_all(folder: str, shapes: Sequence[Indenter] = (), architectures: Sequence[int] = ARCHITECTURES) -> None:
    """Compile for GPUs what a batch of labels needs, by default of every shape that ships; a process of its own.

    Args:
        folder: Receives a folder for each module.
        shapes: The shapes.
        architectures: The GPUs, as `ARCHITECTURES`.
    """
    from tacdata.warp_runtime import UNROLLED_ON_GPU, wp

    # Before any kernel is declared: modules then have the names that a machine with a GPU asks for.
    wp.config.max_unroll = UNROLLED_ON_GPU
    from tacdata.skin.derivatives.compilation import derivative_kernels
    from tacdata.skin.press import PressRequest
    from tacdata.skin.solve.compilation import batch_kernels
    from tacdata.skin.solve.meshed_skin import MeshedSkin
    from tacdata.skin.solve.settings import ModelSettings

    skin = MeshedSkin(default_sensor(), ModelSettings())
    surfaces = skin.surfaces([PressRequest(shape, 0.0, 0.0, 0.0, _DEPTHS) for shape in shapes or _shapes()])
    kernels = (*batch_kernels(skin.body, surfaces), *derivative_kernels(skin.body, surfaces))

    def compile_one(module: wp.Module) -> None:
        wp.compile_aot_module(module, arch=architectures, module_dir=Path(folder, module.get_module_identifier()))

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, {kernel.module for kernel in kernels}))


def _shapes() -> list[Indenter]:
    """Return an example of every shape that ships."""
    names = registry.names("tacdata.indenters", "indenter")
    shipped = (name for name in names if name not in registry.plug_ins("tacdata.indenters"))
    return [registry.load("tacdata.indenters", "indenter", name, Indenter).example() for name in shipped]


if __name__ == "__main__":
    from tacdata.warp_runtime import shipped_kernels

    build(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped_kernels())
