"""Compiles the kernels of labels for a wheel: ``python -m tacdata.label_farm.presses.kernels [FOLDER]``.

Each shape is pressed once into the default skin, with an empty cache. The compiled modules go into a folder, by default
the one that a wheel ships (`tacdata.warp_runtime`). Every kind of processor that this machine is gets its own: some
minutes each.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tacdata import registry
from tacdata.indenters import Indenter
from tacdata.label_farm.presses import model
from tacdata.label_farm.presses.job import Job
from tacdata.sensor import default_sensor

_DEPTHS = (0.0, 0.05, 0.0)
"""Depths of the presses [mm]: down and up, as kernels care for no more."""

_KEPT = ("*.o", "*.meta")
"""Files of a module that Warp reads."""

_PRESS = "from tacdata.label_farm.presses.kernels import press_all; press_all()"


def build(folder: Path) -> None:
    """Replace the modules of Warp's release in a folder by those of all shapes."""
    from tacdata.warp_runtime import KERNELS, processors, wp

    shutil.rmtree(folder / wp.__version__, ignore_errors=True)
    for processor in processors():
        with tempfile.TemporaryDirectory() as empty:
            # An empty folder of the processor makes Warp compile for it.
            (Path(empty) / "kernels" / wp.__version__ / processor).mkdir(parents=True)
            places = {"WARP_CACHE_PATH": f"{empty}/cache", KERNELS: f"{empty}/kernels"}
            subprocess.run([sys.executable, "-c", _PRESS], env={**os.environ, **places}, check=True)
            for module in sorted(Path(empty, "cache").glob("*/wp_*")):
                place = folder / wp.__version__ / processor / module.name
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


def _shapes() -> list[Indenter]:
    """Return an example of every shape that ships."""
    names = registry.names("tacdata.indenters", "indenter")
    shipped = (name for name in names if name not in registry.plug_ins("tacdata.indenters"))
    return [registry.load("tacdata.indenters", "indenter", name, Indenter).example() for name in shipped]


if __name__ == "__main__":
    from tacdata.warp_runtime import shipped_kernels

    build(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped_kernels())
