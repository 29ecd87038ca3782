"""Cost of a press of the training plan as `tacdata label` solves it.

    python benchmarks/label_cost.py [--presses 8] [--spreads]

Skins are built before. Presses are solved as one batch, as a worker takes them. Kernels that are not in Warp's cache
are compiled within the time: run it twice.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import time
from dataclasses import replace

import numpy as np
import torch

from tacdata.label_farm.presses.fem import FemModel
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.labels import PathSolution
from tacdata.plans.shipped.training import training_plan
from tacdata.sensor import Sensor, default_sensor


def jobs(sensor: Sensor, count: int, ladder: Ladder, seed: int = 0, order: int = 1) -> list[Job]:
    """Return presses of the plan of 24, in random order; the same ones for every ladder."""
    plan = training_plan(sensor, 24, seed)
    presses = [plan["presses"][k] for k in np.random.default_rng(order).permutation(24)[:count]]
    return [
        Job(
            sensor.content_hash,
            "benchmark",
            plan["indenters"][press["indenter"]],
            press["x"],
            press["y"],
            press["yaw"],
            ladder.depths(press["depth"]),
            ladder.tolerance,
        )
        for press in presses
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presses", type=int, default=8)
    parser.add_argument("--spreads", action="store_true", help="with standard deviations")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    sensor = default_sensor() if arguments.spreads else replace(default_sensor(), uncertainty={})
    farm, asked = FemModel(sensor), jobs(sensor, arguments.presses, Ladder())
    models = [farm._model, *filter(None, [farm._model.companion])]
    for model in models:
        _ = model.skin.rest
    began = time.process_time()
    solutions = [solution for _, solution in farm.solve_many(asked) if isinstance(solution, PathSolution)]
    spent = time.process_time() - began
    parameters = [solution.provenance["parameters"] for solution in solutions]
    print(f"{spent / len(asked):.2f} CPU s a press, {np.mean([len(s.depth) for s in solutions]):.1f} states")
    changed = np.mean([np.sum(solution.status_steps) for solution in solutions])
    print(f"{np.mean([own['newton'] for own in parameters]):.1f} Newton steps a press, {changed:.1f} changed contact")
    for model in models:
        print(f"steps of the batch on {len(model.mesh.nodes)} nodes: {model.last_run}")


if __name__ == "__main__":
    main()
