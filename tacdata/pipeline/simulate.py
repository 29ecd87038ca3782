"""A dataset of simulated presses."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from tacdata.errors import SolveError, UsageError
from tacdata.label_farm.environment import cores
from tacdata.label_farm.simulated.crew import chosen_devices, solve_all
from tacdata.label_farm.simulated.plan import DEFAULT, read_simulation_plan
from tacdata.label_farm.simulated.press_effects import effects_of, with_effects
from tacdata.label_farm.simulated.simulation import Simulation
from tacdata.paths import StrPath
from tacdata.sensor import Sensor, default_sensor, read_sensor

if TYPE_CHECKING:
    from tacdata.dataset.reader import Dataset

# A computer that only solves needs no recorder: the packer of datasets is imported when one is asked for.
COMPILE, SOLVE, WRITE = "compile", "solve", "write"
"""Stages."""

type SimulationProgress = Callable[[str, int, int], None]
"""Called with the stage, the number of presses done and of all; while kernels compile, of their modules."""


@dataclass(frozen=True)
class SimulatedPresses:
    """The result of a simulation."""

    solved: Path
    """Folder of the solved presses; more presses or other noise reuse them."""
    presses: int
    """Presses in all."""
    new: int
    """Presses that were solved now, or given up."""
    given_up: Counter[str]
    """Reason -> presses that have no equilibrium."""
    root: Path | None = None
    """The dataset; None if presses were only solved."""
    episodes: int = 0
    """Episodes of the dataset."""
    frames: int = 0
    """Frames of the dataset."""
    specimens: int = 0
    """Skins that the presses were distributed over."""
    left_out: Counter[str] = field(default_factory=Counter)
    """Reason -> solved presses that the dataset does not hold."""

    @property
    def dataset(self) -> Dataset:
        """The dataset, opened.

        Raises:
            UsageError: If presses were only solved.
        """
        if self.root is None:
            raise UsageError("presses were only solved", "a dataset", "simulate again with a dataset folder")
        from tacdata.dataset.reader import read_dataset

        return read_dataset(self.root)


def simulate(
    out: StrPath | None = None,
    presses: int = 100,
    *,
    plan: StrPath | None = None,
    seed: int = 0,
    sensor: Sensor | StrPath | None = None,
    solved: StrPath | None = None,
    device: str = "auto",
    workers: int | None = None,
    mesh_error: bool = False,
    effects: Sequence[StrPath] = (),
    columns: Sequence[str] = (),
    progress: SimulationProgress = lambda stage, done, total: None,
) -> SimulatedPresses:
    """Make a dataset of random presses by the skin model; stopped and called again, it continues.

    Args:
        out: Dataset folder; None only solves, into ``solved``.
        presses: Number of presses in all.
        plan: Simulation plan: ranges of shapes, depths, noise; None takes the shipped one.
        seed: Same seed, same dataset.
        sensor: The sensor or its file; None takes the shipped TacPrint.
        solved: Folder of solved presses; None takes ``OUT.solved``.
        device: "auto", "cpu", "cuda" for all GPUs, or "cuda:N".
        workers: Processes; None takes one a core or GPU.
        mesh_error: Estimate the error of each map by a coarser mesh; costs about half more.
        effects: Verdicts or model specs whose effects are applied to the readings.
        columns: Optional columns of the labels to add.
        progress: Called after each press.

    Raises:
        UsageError: If neither ``out`` nor ``solved`` is given, or a folder holds another simulation.
        FormatError: If the plan does not fit the sensor.
        SolveError: If no press has an equilibrium.
    """
    if out is None and solved is None:
        raise UsageError("neither --out nor --solved", "a folder to write to", "add --out DATASET")
    extra = _optional(columns) if columns else ()
    folder = Path(solved or f"{out}.solved")
    design = default_sensor() if sensor is None else sensor
    ranges = read_simulation_plan(Path(plan) if plan else DEFAULT)
    for path in effects:
        ranges = with_effects(ranges, effects_of(Path(path)))
    skin = design if isinstance(design, Sensor) else read_sensor(design)
    simulation = Simulation(folder, ranges, skin, seed, mesh_error)
    devices = chosen_devices(device)
    simulation.check()
    simulation.open()
    missing = presses - len({number for number in simulation.settled if number < presses})
    given_up = _solve(simulation, presses, missing, devices, workers, progress) if missing else Counter[str]()
    if given_up.total() == presses:
        raise SolveError("none of the presses has an equilibrium", "presses that the skin can take", "narrow the plan")
    if out is None:
        return SimulatedPresses(folder, presses, missing, given_up)
    from tacdata.label_farm.simulated.packing import write_dataset

    left_out, done = Counter[str](), 0

    def written(number: int, reason: str) -> None:
        nonlocal done
        left_out.update([reason] if reason else [])
        done += 1
        progress(WRITE, done, presses)

    episodes, frames = write_dataset(simulation, presses, Path(out), extra, written)
    if not frames:
        raise SolveError(
            f"none of {presses} presses is left: {left_out.most_common(1)[0][0]}",
            "presses that the skin can take",
            "solve them again into another --solved folder, or narrow the plan",
        )
    specimens = len(simulation.specimens)
    return SimulatedPresses(folder, presses, missing, given_up, Path(out), episodes, frames, specimens, left_out)


def _optional(columns: Sequence[str]) -> tuple[str, ...]:
    from tacdata.dataset.format.features import asked_for

    return asked_for(list(columns))


def _solve(
    simulation: Simulation,
    presses: int,
    missing: int,
    devices: Sequence[str],
    workers: int | None,
    progress: SimulationProgress,
) -> Counter[str]:
    """Solve the missing presses; return the reasons of those given up."""
    given_up, done = Counter[str](), 0

    def settled(number: int, reason: str) -> None:
        nonlocal done
        given_up.update([reason] if reason else [])
        done += 1
        progress(SOLVE, done, missing)

    count = max(1, min(workers or (cores() if devices == ("cpu",) else len(devices)), missing))
    solve_all(simulation, presses, devices, count, settled, partial(progress, COMPILE))
    return given_up
