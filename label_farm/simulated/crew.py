"""Processes that solve a simulation side by side: one a core, or one a GPU."""

from __future__ import annotations

import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from tacdata.errors import SolveError, UsageError
from tacdata.label_farm import environment
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.label_farm.simulated.solving import solve

KERNELS = "kernels"
"""First word of a line about modules of kernels; other lines begin with the number of a press."""


def chosen_devices(name: str) -> tuple[str, ...]:
    """Return the devices: "auto" takes all GPUs of this machine, or its CPU where it has none.

    Raises:
        UsageError: If the device is not there.
    """
    if name != "auto":
        return environment.devices((name,))
    try:
        return environment.devices(("cuda",))
    except UsageError:
        return ("cpu",)


def solve_all(
    simulation: Simulation,
    presses: int,
    devices: Sequence[str],
    workers: int,
    settled: Callable[[int, str], None],
    loading: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Solve missing presses by ``workers`` processes; in this one for 1.

    Args:
        simulation: The simulation.
        presses: How many presses are wanted in all.
        devices: Devices of the workers, one after the other.
        workers: How many processes.
        settled: Called with each press's number, and why it was given up or "".
        loading: Called with the modules of kernels that a process has loaded, and of all.

    Raises:
        SolveError: If a specimen cannot be modelled, or a worker dies.
    """
    simulation.open()
    if workers == 1:
        from tacdata.warp_runtime import report_modules

        with report_modules(loading):
            solve(simulation, presses, devices[0], settled=settled)
        return
    hear = settled, loading
    crew = [_Hand(simulation.folder, presses, k, workers, devices[k % len(devices)], *hear) for k in range(workers)]
    try:
        for hand in crew:
            hand.join()
    finally:
        for hand in crew:
            hand.stop()


class _Hand:
    """One process, and a thread that listens to it."""

    def __init__(
        self,
        folder: Path,
        presses: int,
        index: int,
        of: int,
        device: str,
        settled: Callable[[int, str], None],
        loading: Callable[[int, int], None],
    ) -> None:
        self._errors: IO[bytes] = tempfile.TemporaryFile()
        # A process group of its own: Ctrl-C reaches this process alone, which stops the others.
        self._process = subprocess.Popen(
            [*environment.python("tacdata.label_farm.simulated.worker"), str(folder), *map(str, (presses, index, of))],
            env=environment.variables(device),
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            process_group=0,
        )
        self._thread = threading.Thread(target=self._listen, args=(settled, loading), daemon=True)
        self._thread.start()

    def _listen(self, settled: Callable[[int, str], None], loading: Callable[[int, int], None]) -> None:
        if self._process.stdout is None:
            return
        with self._process.stdout as lines:
            for line in lines:
                number, _, reason = line.rstrip("\n").partition(" ")
                if number == KERNELS:
                    loading(*map(int, reason.split()))
                else:
                    settled(int(number), reason)

    def join(self) -> None:
        """Wait for its end.

        Raises:
            SolveError: If it did not end well.
        """
        self._thread.join()
        if code := self._process.wait():
            self._errors.seek(0)
            words = self._errors.read().decode(errors="replace")[-2000:].strip()
            raise SolveError(
                f"a process that solves presses ended with {code}:\n{words}",
                "processes that end well",
                "see the lines above; run again to go on: what was written is kept",
            )

    def stop(self) -> None:
        """End it, if it still runs."""
        self._process.terminate()
        self._process.wait()
        self._thread.join()
        self._errors.close()
