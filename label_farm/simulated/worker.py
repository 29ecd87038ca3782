"""A process that solves a share of a simulation: ``python -m label_farm.simulated.worker FOLDER PRESSES INDEX OF``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tacdata.label_farm import environment
from tacdata.label_farm.simulated.crew import KERNELS
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.solving import Share, solve


def main() -> None:
    """Solve; a line with its number, and perhaps its error, reports a settled press, another loaded kernels."""
    folder, presses, index, of = sys.argv[1:]
    tell = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # output of libraries must not mix with it
    from tacdata.warp_runtime import report_modules

    with report_modules(lambda count, about: print(KERNELS, count, about, file=tell)):
        solve(
            Simulation.read(Path(folder)),
            int(presses),
            os.environ.get(environment.DEVICE, "cpu"),
            Share(int(index), int(of)),
            lambda number, reason: print(number, reason.replace("\n", " "), file=tell),
        )


if __name__ == "__main__":
    main()
