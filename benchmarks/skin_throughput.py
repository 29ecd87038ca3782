"""How many converged states per second the skin model solves when many presses share one mesh, on a CPU or a GPU.

Random presses of spheres of several sizes over the pad, down to a random depth by states 0.25 mm apart. A state counts
when its residual and penetration are within the solver's settings. CPU seconds on the CPU, wall seconds on a GPU.

    python benchmarks/skin_throughput.py [--device cuda:0] [--presses N] [--batch N] [--mesh FILE.npz] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch

from tacdata.errors import SolveError
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import default_sensor
from tacdata.skin.mesh.skin_mesh import SkinMesh
from tacdata.skin.model import SkinModel
from tacdata.skin.press import PressRequest


def presses(count: int, seed: int = 0) -> list[PressRequest]:
    """Return random presses inside the rim of the default sensor."""
    random = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        depth = float(random.choice([0.5, 0.75, 1.0, 1.25]))
        depths = tuple(np.arange(1, round(depth / 0.25) + 1) * 0.25)
        x, y = random.uniform(-4.5, 4.5), random.uniform(-2.5, 2.5)
        made.append(PressRequest(Sphere(float(random.choice([2.0, 3.0, 4.0]))), float(x), float(y), 0.0, depths))
    return made


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--presses", type=int, default=8)
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--mesh", type=Path)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    on_gpu = arguments.device != "cpu"
    mesh = SkinMesh.load(arguments.mesh) if arguments.mesh else None
    began = time.perf_counter()
    model = SkinModel(default_sensor(), device=arguments.device, mesh=mesh)
    requests = presses(arguments.presses)
    list(model.states_many(requests[: max(1, arguments.batch // 8)], arguments.batch, False))
    built = time.perf_counter() - began
    clock = time.perf_counter if on_gpu else time.process_time
    began, states, failures, residual, newton, changed = clock(), 0, 0, [], 0, 0
    for _, _, state in model.states_many(requests, arguments.batch, False):
        if isinstance(state, SolveError):
            failures += 1
            print(state)
            continue
        states, newton, changed = states + 1, newton + state.newton, changed + state.changed
        residual.append(state.residual)
    if on_gpu:
        torch.cuda.synchronize()
    seconds = clock() - began
    figures = {
        "device": arguments.device,
        "nodes": len(model.mesh.nodes),
        "presses": len(requests),
        "batch": arguments.batch,
        "states": states,
        "failures": failures,
        "seconds": seconds,
        "states_per_second": states / seconds,
        "newton_per_state": newton / max(states, 1),
        "changed_contact_per_state": changed / max(states, 1),
        "largest_residual": max(residual),
        "build_seconds": built,
        **model.last_run,
    }
    for name, value in figures.items():
        print(f"{name:>22} {value:.4g}" if isinstance(value, float) else f"{name:>22} {value}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
