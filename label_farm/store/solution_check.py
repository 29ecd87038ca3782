"""Checks a solution before it enters the store."""

from __future__ import annotations

import numpy as np

from tacdata.errors import SolveError
from tacdata.label_farm.presses.job import Job
from tacdata.labels import PathSolution
from tacdata.labels.columns import PATH, PATH_OPTIONAL
from tacdata.sensor import Sensor


def check_solution(job: Job, solution: PathSolution, sensor: Sensor) -> None:
    """Refuse a solution that is not finite, not of the job's path, or not of the sensor's shapes.

    Raises:
        SolveError: If a value is not finite, a shape is not the sensor's, or the path is not the job's.
    """
    states = len(solution.depth)
    for name, quantity in PATH.items():
        if name in PATH_OPTIONAL and getattr(solution, name) is None:
            continue
        shape = quantity.shape(states, sensor.map.shape, sensor.taxels.count)
        values = np.asarray(getattr(solution, name))
        if values.shape != shape or not np.isfinite(values).all():
            raise SolveError(
                f"the solver returned {name} of shape {values.shape}, {int(np.isfinite(values).sum())} of "
                f"{values.size} values finite",
                f"finite values of shape {shape}",
                "report this press: it is kept as a failure, never as a label",
            )
    steps = np.diff(solution.depth)
    peak = int(np.argmax(solution.depth)) if states else 0
    single = states >= 3 and bool((steps[:peak] > 0).all() and (steps[peak:] < 0).all())
    ends = single and solution.depth[0] == 0 and solution.depth[-1] == 0
    if not ends or abs(solution.depth.max() - job.deepest) > 1e-6:
        raise SolveError(
            f"the solver returned the depths {np.round(solution.depth, 3).tolist()} mm",
            f"a path from 0 to {job.deepest:g} mm and back to 0",
            "report this press: it is kept as a failure, never as a label",
        )
