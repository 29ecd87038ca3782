"""Error of the force at small depths, and what labels state of it.

    python benchmarks/small_depths.py [--edge 0.2] [--radii 2 4]

Spheres press a slab of 4 mm and the default sensor, above a protrusion and between four. The truth is the same press on
a mesh with short edges around the contact, solved ten times as tightly.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import torch

from tacdata.indenters.sphere import Sphere
from tacdata.sensor import Sensor, default_sensor
from tacdata.skin.mesh.build import MeshSettings
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.settings import SolverSettings

DEPTHS = (0.15, 0.25, 0.5)
"""[mm]"""
AROUND = 1.6
"""Radius of the disc of short edges [mm]."""
TIGHT = SolverSettings(residual=5e-5, penetration=1e-3, mean_penetration=3e-5, newton_limit=200, patience=40)


def slab() -> Sensor:
    """Return a slab of the default material, held from below, without friction."""
    document = default_sensor().document
    document.pop("uncertainty", None)
    document["skin"] = {"size_x": 16.0, "size_y": 12.0, "thickness": 4.0, "protrusion_radius": 0.0}
    document["contact"] = {"friction": 0.0, "bonded": ["bottom"], "board": False}
    return Sensor.from_document(document, "slab")


def main() -> None:
    """Solve and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--edge", type=float, default=0.2, help="edges around the contact [mm]")
    parser.add_argument("--radii", type=float, nargs="+", default=[2.0, 4.0])
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    cases = {
        "slab": (slab(), 0.3, 0.2),
        "above": (default_sensor(), 0.95, 1.25),
        "between": (default_sensor(), 0.0, 0.0),
    }
    print("| press | radius mm | depth mm | force N | off % | stated % |\n|---|---|---|---|---|---|")
    for name, (sensor, x, y) in cases.items():
        model = SkinModel(sensor)
        mesh = MeshSettings(focus=(x, y, AROUND, arguments.edge))
        finer = SkinModel(sensor, replace(ModelSettings(error_estimate=False), mesh=mesh, solver=TIGHT))
        for radius in arguments.radii:
            press = PressRequest(Sphere(radius), x, y, 0.0, DEPTHS)
            found, truth = model.solve(press), finer.solve(press)
            for k, depth in enumerate(DEPTHS):
                force, best = found.force[k, 2], truth.force[k, 2]
                off, stated = 100 * (force / best - 1), 100 * found.force_error[k] / force
                print(f"| {name} | {radius:g} | {depth:g} | {force:.4f} | {off:+.2f} | {stated:.1f} |", flush=True)


if __name__ == "__main__":
    main()
