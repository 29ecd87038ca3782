"""Error of labels between the states that are solved, on the way down and up, and whether they state it.

    python benchmarks/label_states.py [--presses 4] [--seed 7]

Presses of a training plan are solved as `tacdata label` does it, and again at steps of 0.1 mm. "Lost" is the difference
of a label to a state that it did not know: root mean square over dented pixels.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
from dataclasses import replace

import numpy as np
import torch
from label_cost import jobs

from tacdata.label_farm.presses.fem import FemModel
from tacdata.label_farm.presses.interpolate import Branch
from tacdata.label_farm.presses.job import Job
from tacdata.label_farm.presses.ladder import Ladder
from tacdata.labels import PathSolution
from tacdata.sensor import default_sensor

LADDERS = {"every step both ways": Ladder(0.05, 1.6, 0.25, 0.25), "today's": Ladder()}
DENSE = Ladder(0.03, 1.5, 0.1, 0.1, tolerance=None)
DENTED = 0.1
"""Share of the depth from which a pixel counts [1]."""


def solved(farm: FemModel, asked: list[Job]) -> dict[tuple[float, float], PathSolution]:
    """Return solutions by place."""
    return {(job.x, job.y): solution for job, solution in farm.solve_many(asked) if isinstance(solution, PathSolution)}


def lost(known: PathSolution, truth: PathSolution, loading: bool) -> np.ndarray:
    """Return one row a state that ``known`` lacks.

    Columns: lost [um], of the force's peak [%], share of dented pixels within the bound of interpolation, and within
    twice all that a label states [1].
    """
    branch, own = Branch.of(known, "surface", loading), Branch.of(truth, "surface", loading)
    force, own_force = Branch.of(known, "force", loading), Branch.of(truth, "force", loading)
    mesh = Branch.of(known, "numerical", loading)
    new = [k for k, depth in enumerate(own.depth) if np.abs(branch.depth - depth).min() > 0.005]
    at = own.depth[new]
    error = np.abs(branch.at(at) - own.states[new])
    bound = branch.bound(at)
    stated = np.hypot(bound, mesh.at(at))
    dented = own.states[new] > DENTED * at[:, None]
    count = np.maximum(dented.sum(axis=1), 1)
    peak = np.linalg.norm(own_force.states, axis=1).max()
    return np.stack(
        [
            1e3 * np.sqrt((error**2 * dented).sum(axis=1) / count),
            100 * np.linalg.norm(force.at(at) - own_force.states[new], axis=1) / peak,
            ((error <= bound + 1e-4) & dented).sum(axis=1) / count,
            ((error <= 2 * stated + 1e-4) & dented).sum(axis=1) / count,
        ],
        axis=1,
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--presses", type=int, default=4)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    seed = arguments.seed
    sensor = replace(default_sensor(), uncertainty={})
    farm = FemModel(sensor)
    truth = solved(farm, jobs(sensor, arguments.presses, DENSE, seed, seed))
    for name, ladder in LADDERS.items():
        found = solved(farm, jobs(sensor, arguments.presses, ladder, seed, seed))
        states = np.mean([len(one.depth) for one in found.values()])
        steps = np.mean([one.provenance["parameters"]["newton"] for one in found.values()])
        print(f"{name}: {states:.1f} states, {steps:.1f} Newton steps a press")
        for loading in (True, False):
            rows = np.concatenate([lost(found[place], truth[place], loading) for place in found])
            way, most = "down" if loading else "up", rows.max(axis=0)
            bound, stated = rows[:, 2].mean(), rows[:, 3].mean()
            print(f"  {way}: lost median {np.median(rows[:, 0]):.1f}, most {most[0]:.1f} um")
            print(f"    force most {most[1]:.2f} % of its peak")
            print(f"    pixels within the bound {bound:.2f}, within twice all that is stated {stated:.2f}")


if __name__ == "__main__":
    main()
