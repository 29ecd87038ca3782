"""Cost of an equilibrium of the default skin and its distance from convergence: a ladder of meshes, one press.

Prints a table and, with ``--json FILE``, the figures. Time is CPU time of one process on one core; errors are against
the finest mesh of the run, so they show convergence, not truth (`tests/skin` holds the model against other codes).

    python benchmarks/skin_equilibria.py [--json FILE] [--rungs 3]
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch

from tacdata.indenters.sphere import Sphere
from tacdata.sensor import default_sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

RUNGS = (MeshSettings(outer=0.8, tip=0.24), MeshSettings(), MeshSettings(outer=0.45, interior=1.8, tip=0.13))
DEPTHS = (0.25, 0.5, 0.75, 1.0)
WIDTHS = (7, 8, 9, 7, 5, 7, 29, 29)


def measure(mesh: MeshSettings) -> dict:
    """Solve the press on one mesh; return counts, CPU seconds, maps and forces."""
    sensor = default_sensor()
    began = time.process_time()
    model = SkinModel(sensor, ModelSettings(mesh=mesh, error_estimate=False))
    request = PressRequest(Sphere(4.0), 0.95, 1.25, 0.0, DEPTHS)
    model.solve(PressRequest(Sphere(4.0), 0.95, 1.25, 0.0, (0.05,)))  # compiles, factorizes
    built = time.process_time() - began
    began = time.process_time()
    solution = model.solve(request)
    spent = time.process_time() - began
    return {
        "nodes": len(model.mesh.nodes),
        "elements": len(model.mesh.tets),
        "build_s": built,
        "s_per_equilibrium": spent / len(DEPTHS),
        "newton": model.last_run["ticks"],
        "cg": model.last_run["cg"],
        "surface": solution.surface,
        "force": solution.force[:, 2],
        "largest_misfit_percent": float(100 * (solution.penetration / np.array(DEPTHS)).max()),
    }


def main() -> None:
    """Run the ladder and print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--rungs", type=int, default=len(RUNGS), choices=range(1, len(RUNGS) + 1))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    rungs = [measure(mesh) for mesh in RUNGS[: arguments.rungs]]
    finest = rungs[-1]
    print(f"depths {DEPTHS} mm; force and map against the finest mesh, per cent")
    heads = ("nodes", "build s", "s/equil.", "Newton", "CG", "misfit", "force", "map rms")
    print(" ".join(f"{head:>{width}}" for head, width in zip(heads, WIDTHS, strict=True)))
    for rung in rungs:
        force = 100 * (rung["force"] / finest["force"] - 1)
        rms = 100 * np.sqrt(((rung["surface"] - finest["surface"]) ** 2).mean(axis=(1, 2))) / np.array(DEPTHS)
        rung["force_off_percent"], rung["map_rms_percent"] = force.tolist(), rms.tolist()
        values = (
            f"{rung['nodes']}",
            f"{rung['build_s']:.1f}",
            f"{rung['s_per_equilibrium']:.2f}",
            f"{rung['newton']}",
            f"{rung['cg']}",
            f"{rung['largest_misfit_percent']:.2f}",
            str(np.round(force, 2)),
            str(np.round(rms, 3)),
        )
        print(" ".join(f"{value:>{width}}" for value, width in zip(values, WIDTHS, strict=True)))
    if arguments.json:
        plain = [{k: v for k, v in rung.items() if not isinstance(v, np.ndarray)} for rung in rungs]
        arguments.json.write_text(json.dumps(plain, indent=1) + "\n")


if __name__ == "__main__":
    main()
