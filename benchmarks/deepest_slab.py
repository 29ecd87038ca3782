"""Which solution is right where ours and a stored one differ: the slab of family A on finer and finer meshes.

    python benchmarks/deepest_slab.py A1 [--edges 0.9 0.6 0.45] [--reference FOLDER] [--json FILE]
    python benchmarks/deepest_slab.py A4 [--edges 1.0 0.75 0.5]

Structured meshes, so that only the size changes: edges [mm] of the cells below the indenter, growing by a quarter from
cell to cell outside. A1 is a sphere without friction. A4 is a punch of 2 mm radius with a fillet of 0.3 mm, whose cells
are half as wide below the fillet. FOLDER holds the stored solutions (A1.json, ...).
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "skin"))

from skin_examples import kuhn_mesh

from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import Sensor, default_sensor
from tacdata.sensor.sensor import ContactProperties, Skin
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest

REFERENCE = Path(__file__).resolve().parents[2] / "shared" / "reference"
SIZE = np.array([16.0, 12.0, 4.0])
GROWTH = 1.25
CASES = {
    "A1": (PressRequest(Sphere(4.0), 0.0, 0.0, 0.0, (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)), 0.0, (0.9, 0.6, 0.45)),
    "A4": (PressRequest(FlatPunch(2.0, 0.3), -2.0, 1.0, 0.0, (0.25, 0.5, 0.75, 1.0)), 0.2, (1.0, 0.75, 0.5)),
}
"""The press, its friction, and edges [mm]."""


def sensor(friction: float) -> Sensor:
    """Return the slab of family A."""
    contact = ContactProperties(friction, ("bottom",), False)
    return replace(default_sensor(), name="slab", skin=Skin(*SIZE, 0.0), contact=contact, uncertainty={})


def outward(begin: float, end: float, edge: float) -> np.ndarray:
    """Return lines from one place to another [mm], the first left out: cells of an edge [mm], growing by `GROWTH`."""
    steps = [edge]
    while sum(steps) < abs(end - begin):
        steps.append(GROWTH * steps[-1])
    return begin + np.cumsum(steps) / sum(steps) * (end - begin)


def even(begin: float, end: float, edge: float) -> np.ndarray:
    """Return lines between two places [mm], both included, no farther apart than an edge."""
    return np.linspace(begin, end, int(np.ceil((end - begin) / edge - 1e-9)) + 1)


def lines(middle: float, half: float, edge: float, request: PressRequest) -> np.ndarray:
    """Return the lines of one axis [mm]: even below the indenter, growing outside."""
    if isinstance(request.indenter, FlatPunch):
        inner, outer = 1.5, 2.2  # the fillet is between 1.7 and 2 mm
        ring = even(inner, outer, edge / 2)
        below = np.concatenate([-ring[::-1], even(-inner, inner, edge)[1:-1], ring])
        edge /= 2
    else:
        below = even(-3.0, 3.0, edge)  # the contact's radius is 2.6 mm at 1.5 mm
    below = middle + below
    return np.concatenate([outward(below[0], -half, edge)[::-1], below, outward(below[-1], half, edge)])


def solve(case: str, edge: float) -> dict:
    """Return the forces [N] on one mesh, its nodes and the CPU seconds of all states."""
    request, friction, _ = CASES[case]
    slab = sensor(friction)
    depth = edge / 2 if case == "A4" else edge
    axes = [
        lines(request.x, SIZE[0] / 2, edge, request),
        lines(request.y, SIZE[1] / 2, edge, request),
        np.concatenate([outward(SIZE[2], 0.0, depth)[::-1], [SIZE[2]]]),
    ]
    model = SkinModel(slab, ModelSettings(error_estimate=False), mesh=kuhn_mesh(slab, axes))
    _, began = model.skin.rest, time.process_time()
    forces = {}
    for at, state in model.states(request):
        forces[at] = float(state.force[2])
        print(f"{case}, {edge:g} mm: {at:g} mm {forces[at]:.4f} N, {time.process_time() - began:.0f} CPU s", flush=True)
    return {"edge": edge, "nodes": len(model.mesh.nodes), "force": forces, "cpu_seconds": time.process_time() - began}


def main() -> None:
    """Solve and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=list(CASES))
    parser.add_argument("--edges", type=float, nargs="+")
    parser.add_argument("--reference", type=Path, default=REFERENCE)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    found = [solve(arguments.case, edge) for edge in arguments.edges or CASES[arguments.case][2]]
    stored = json.loads((arguments.reference / f"{arguments.case}.json").read_text())["results"]
    print("depth [mm]", "stored [N]", *(f"{one['edge']:g} mm, {one['nodes']} nodes" for one in found), sep=" | ")
    for row in stored:
        own = [100 * (one["force"][row["depth"]] / row["force_N"] - 1) for one in found]
        print(f"{row['depth']:g} | {row['force_N']:.4f}", *(f"{off:+.2f} %" for off in own), sep=" | ")
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
