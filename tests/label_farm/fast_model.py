"""A model that answers at once; it notes each solve in a file, so that a test can count them."""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import gate
import numpy as np

from tacdata import provenance
from tacdata.errors import SolveError
from tacdata.labels import PathSolution
from tacdata.sensor.protrusion_pixels import PIXELS


class FastModel:
    """The surface is a bump times the depth. ``FAST_MODEL_*`` variables make it wait, slow, wrong or deadly."""

    def __init__(self, sensor):
        self.sensor = sensor
        self.modules = int(os.environ.get("FAST_MODEL_MODULES", "0"))
        if self.modules:
            from tacdata import warp_runtime  # noqa: F401 -- as a model with kernels does
        self.batch = int(os.environ.get("FAST_MODEL_BATCH", "1"))
        self.remarks = tuple(filter(None, [os.environ.get("FAST_MODEL_REMARK")]))
        self.content_hash = provenance.content_hash(
            [sensor.content_hash, sensor.uncertainty, os.environ.get("FAST_MODEL_VERSION", "1")]
        )

    def solve(self, job):
        log = os.environ.get("FAST_MODEL_LOG")
        if log:
            with open(log, "a") as stream:
                stream.write(f"{os.getpid()} {job.x:g}\n")
        self.load_kernels()
        if closed := os.environ.get(gate.VARIABLE):
            gate.pass_gate(closed)
        time.sleep(float(os.environ.get("FAST_MODEL_SECONDS", "0")))
        if f"{job.x:g}" in os.environ.get("FAST_MODEL_FAILS", "").split():
            raise SolveError("no equilibrium at state 3", "convergence in 50 iterations", "reduce the depth")
        if f"{job.x:g}" in os.environ.get("FAST_MODEL_KILLS", "").split():
            os.kill(os.getpid(), 9)
        if f"{job.x:g}" in os.environ.get("FAST_MODEL_KILLS_ONCE", "").split():
            mark = Path(os.environ["FAST_MODEL_LOG"] + ".killed")
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), 9)
        solution = path(self.sensor, job.depths, lambda d: d, job.x, bad=os.environ.get("FAST_MODEL_NAN") == "1")
        # A tenth of everything for every spread that the sensor states.
        return with_spread(solution, 0.1 * len(self.sensor.uncertainty)) if self.sensor.uncertainty else solution

    def load_kernels(self):
        """Say what Warp says of modules that take long to compile."""
        for number in range(self.modules):
            time.sleep(1.2)
            sys.modules["tacdata.warp_runtime"].wp.get_logger().info(f"Module m{number} load on device 'cpu' took 1 ms")
        self.modules = 0


def with_spread(solution, share):
    """The path with standard deviations that are a share of its values."""
    return replace(
        solution,
        uncertainty=share * np.abs(solution.surface),
        force_uncertainty=share * np.abs(solution.force),
        taxel_force_uncertainty=share * solution.taxel_force,
        taxel_closure_uncertainty=share * solution.taxel_closure,
    )


def path(sensor, depths, answer, x=0.0, bad=False, numerical=0.0):
    """A path whose surface is ``answer(depth)`` times a bump around x, every error ``numerical`` times ``answer``."""
    depth = np.array(depths)
    bump = np.exp(-((sensor.map.x[:, None] - x) ** 2 + sensor.map.y[None] ** 2) / 4.0)
    values = np.array([answer(d) for d in depth])
    if bad:
        values[1] = np.nan
    taxels = np.ones(sensor.taxels.count)
    return PathSolution(
        depth=depth,
        surface=values[:, None, None] * bump,
        taxel_force=values[:, None] * taxels,
        taxel_closure=values[:, None] * taxels,
        taxel_area=values[:, None] * taxels,
        force=values[:, None] * np.array([0.0, 0.0, -1.0]),
        numerical=np.abs(values)[:, None, None] * numerical * np.ones_like(bump),
        force_error=np.abs(values) * numerical,
        taxel_force_error=np.abs(values)[:, None] * numerical * taxels,
        # As little of the map is in contact as of a real one.
        traction=values[:, None, None, None] * np.maximum(bump - 0.8, 0.0) * np.array([0.1, 0.0, 1.0])[:, None, None],
        taxel_pressure=(
            values[:, None, None, None] * np.outer(*2 * [np.hanning(PIXELS)]) * taxels[:, None, None]
            if sensor.contact.board
            else None
        ),
        status_steps=np.full(len(depth), 2.0),
        equilibrium_steps=np.full(len(depth), 3.0),
        residual=np.zeros(len(depth)),
        penetration=np.zeros(len(depth)),
        provenance={"law": "bump"},
    )
