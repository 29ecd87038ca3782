"""Error by the solver's tolerance against the exact solution on one mesh, and the cost of tighter settings.

    python benchmarks/skin_tolerance.py [--device cuda:0]

Four indenters on the default mesh, two depths each: settings so tight that nothing is left, the default ones, and ones
three times tighter. The mesh's own error is another matter (`skin_error_ladder.py`).
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from tacdata.indenters.cylinder import Cylinder
from tacdata.indenters.flat_punch import FlatPunch
from tacdata.indenters.sphere import Sphere
from tacdata.sensor import default_sensor
from tacdata.skin.model import ModelSettings, SkinModel
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.settings import SolverSettings

PRESSES = (
    PressRequest(Sphere(2.0), 0.5, -0.3, 0.0, (0.5, 1.0)),
    PressRequest(FlatPunch(1.5, 0.2), -0.6, 0.2, 0.0, (0.3, 0.6)),
    PressRequest(FlatPunch(1.0, 0.9), -0.6, 0.2, 0.0, (0.3, 0.6)),
    PressRequest(Cylinder(1.2, 2.0, 0.5), 0.1, 0.0, 30.0, (0.3, 0.6)),
)
DEFAULT = SolverSettings()
TIGHTER = SolverSettings(residual=2e-4, penetration=1e-3, mean_penetration=1e-4)
EXACT = SolverSettings(residual=1e-5, penetration=1e-4, mean_penetration=1e-5, newton_limit=300, patience=60)


def main() -> None:
    """Solve and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    device = parser.parse_args().device
    plain, mesh, exact = ModelSettings(error_estimate=False), None, []
    print(
        f"{'settings':10s} {'press':26s} {'seconds':>8s} {'force':>9s} {'largest of the map':>19s} "
        f"{'rms of the map':>15s}"
    )
    for name, solver in (("exact", EXACT), ("default", DEFAULT), ("tighter", TIGHTER)):
        model = SkinModel(default_sensor(), replace(plain, solver=solver), device, mesh)
        mesh = model.mesh
        for number, press in enumerate(PRESSES):
            begun = time.perf_counter()
            found = model.solve(press)
            seconds = time.perf_counter() - begun
            if name == "exact":
                exact.append(found)
            best = exact[number]
            force = np.abs(found.force - best.force).max() / np.abs(best.force).max()
            off = (found.surface - best.surface) / best.depth[:, None, None]
            shape = f"{type(press.indenter).__name__} at {press.x}, {press.y}"
            print(
                f"{name:10s} {shape:26s} {seconds:8.1f} {force:9.1e} {np.abs(off).max():19.1e} {off.std():15.1e}",
                flush=True,
            )


if __name__ == "__main__":
    main()
