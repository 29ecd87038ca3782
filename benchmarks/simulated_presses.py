"""Cost of a simulated press, from the plan to a frame of the dataset: solving, writing, and how large it becomes.

Presses of the first specimen of a plan, in the order of their numbers; as many again are solved before, so that
kernels are compiled. CPU seconds on one thread of a CPU, wall seconds on a GPU.

    python benchmarks/simulated_presses.py [--device cuda:0] [--presses N] [--plan FILE.yaml] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import torch

from tacdata.label_farm.simulated import solving
from tacdata.label_farm.simulated.packing import write_dataset
from tacdata.label_farm.simulated.plan import DEFAULT, read_simulation_plan
from tacdata.label_farm.simulated.shard import read_shard, shard_files
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.sensor import default_sensor


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--presses", type=int, default=16)
    parser.add_argument("--plan", type=Path, default=DEFAULT)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    plan = read_simulation_plan(arguments.plan)
    clock = time.process_time if arguments.device == "cpu" else time.perf_counter
    with tempfile.TemporaryDirectory() as folder:
        warm, cold = (Simulation(Path(folder) / name, plan, default_sensor(), 0) for name in ("warm", "cold"))
        count = plan.specimens.count
        for simulation in (cold, warm):
            simulation.open()
            began = clock()
            for specimen, numbers in simulation.missing(arguments.presses * count, arguments.presses):
                if specimen == 0:
                    model = solving.specimen_model(simulation, 0, arguments.device)
                    built, began = clock() - began, clock()
                    batch = solving.solve_batch(simulation, model, numbers, arguments.device)
                    solved = clock() - began
                    batch.write(simulation.folder)
        began = time.process_time()
        _, frames = write_dataset(warm, arguments.presses * count, Path(folder) / "dataset")
        wrote = time.process_time() - began
        [path] = shard_files(warm.folder)
        shard = read_shard(path)
        states = sum(len(solution.depth) for solution in shard.solutions.values())
        figures = {
            "device": arguments.device,
            "presses": arguments.presses,
            "given_up": len(shard.failed),
            "states": states,
            "build_seconds": built,
            "seconds_a_press": solved / arguments.presses,
            "presses_an_hour": 3600 * arguments.presses / solved,
            "frames": frames,
            "write_seconds_a_press": wrote / arguments.presses,
            "kB_a_press": path.stat().st_size / arguments.presses / 1e3,
        }
    for name, value in figures.items():
        print(f"{name:>22} {value:.4g}" if isinstance(value, float) else f"{name:>22} {value}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
