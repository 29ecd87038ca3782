"""Orders of the mesh's error, and whether the error that labels state covers the true one.

    python benchmarks/skin_error_ladder.py [--cells 6 8 10 12 16] [--json FILE]

A slab of 6 x 6 x 2 mm, bottom bonded, under a sphere of 2 mm radius at depths of 0.25, 0.5 and 0.75 mm, on structured
meshes; the finest is taken for the truth. For every pair of the others the error is stated from the coarser
(`tacdata.skin.validity.mesh_error`) and compared with the finest.
"""

from __future__ import annotations

import argparse
import json
import sys
from itertools import combinations
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "skin"))

from skin_examples import box_mesh, slab_sensor

from tacdata.indenters.sphere import Sphere
from tacdata.skin.contact.first_touch import reach
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.validity.mesh_error import Figures, estimate

SIZE, THICKNESS = 6.0, 2.0
SENSOR = slab_sensor(size=SIZE, thickness=THICKNESS)
# Off the middle, where the mesh would be symmetric about the press.
PRESS = PressRequest(Sphere(2.0), 0.11, -0.07, 0.0, (0.25, 0.5, 0.75))


def figures(cells: int) -> Figures:
    """Return the press on a mesh of so many cells along each side."""
    mesh = box_mesh(SENSOR, cells, cells, max(2, round(cells * THICKNESS / SIZE)))
    model = SkinModel(SENSOR, ModelSettings(error_estimate=False), mesh=mesh)
    return model.figures(PRESS, PRESS.depths, [state for _, state in model.states(PRESS)])


def compare(found: dict[int, Figures]) -> dict:
    """Return orders by depth, and stated over true error for every pair of meshes but the finest."""
    *coarser, finest = sorted(found)
    best, edges = found[finest], np.log([SIZE / n for n in coarser])
    force = np.array([np.abs(found[n].force[:, 2] - best.force[:, 2]) for n in coarser])
    rms = np.array([np.sqrt(((found[n].surface - best.surface) ** 2).mean(axis=(1, 2))) for n in coarser])
    pairs = []
    for (_, coarse), (b, fine) in combinations(list(enumerate(coarser)), 2):
        stated = estimate(SENSOR, found[fine], found[coarse], max(reach(SENSOR, PRESS)), fine / coarse)
        off = np.abs(found[fine].surface - best.surface)
        pairs.append(
            {
                "cells": [coarse, fine],
                "force": (stated.force / force[b]).tolist(),
                "map_rms": (np.sqrt((stated.surface**2).mean(axis=(1, 2))) / rms[b]).tolist(),
                "pixels_within_two": (off <= 2 * stated.surface).mean(axis=(1, 2)).tolist(),
            }
        )
    return {
        "force_error": (force / best.force[:, 2]).tolist(),
        "map_rms_over_depth": (rms / PRESS.depths).tolist(),
        "force_order": [float(np.polyfit(edges, np.log(e), 1)[0]) for e in force.T],
        "map_order": [float(np.polyfit(edges, np.log(e), 1)[0]) for e in rms.T],
        "stated_over_true": pairs,
    }


def main() -> None:
    """Solve the ladder and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[6, 8, 10, 12, 16])
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result = compare({cells: figures(cells) for cells in arguments.cells})
    for name in ("force_order", "map_order"):
        print(f"{name:>12}", *(f"{value:6.2f}" for value in result[name]))
    for pair in result["stated_over_true"]:
        values = [f"{name} " + " ".join(f"{v:5.2f}" for v in pair[name]) for name in list(pair)[1:]]
        print(*pair["cells"], *values, sep="   ")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
