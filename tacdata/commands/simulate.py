"""Make a dataset of simulated presses."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import PIPELINE, Result
from tacdata.progress import bars, say, suggest

ORDER = 45
PANEL = PIPELINE


def run(
    plan: Annotated[
        Path | None, typer.Argument(help="Simulation plan (YAML): ranges of shapes, depths, noise. Default: shipped.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Dataset folder to write; without it, presses are only solved.")
    ] = None,
    presses: Annotated[int, typer.Option(min=1, help="How many presses in all.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same dataset.")] = 0,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file; default: the paper's.")] = None,
    solved: Annotated[
        Path | None, typer.Option(help="Folder of solved presses, a batch a file; default: OUT.solved.")
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda for all GPUs, or cuda:N.")] = "auto",
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core, or one a GPU.")] = None,
    mesh_error: Annotated[
        bool, typer.Option("--mesh-error", help="Ask a coarser mesh how far off each map is; costs about half more.")
    ] = False,
    column: Annotated[
        list[str] | None, typer.Option(help="Optional column of the labels to carry along, such as taxel_counts.")
    ] = None,
) -> Result:
    """Make a dataset of random presses by the skin model; stopped and run again, it goes on.

    The dataset is marked as simulated. Solved presses stay in their folder: more presses or other noise reuse them.
    """
    from label_farm.environment import cores
    from label_farm.simulated.crew import chosen_devices, solve_all
    from label_farm.simulated.plan import DEFAULT, read_simulation_plan
    from label_farm.simulated.simulation import Simulation
    from tacdata.errors import SolveError, UsageError
    from tacdata.sensor import default_sensor, read_sensor

    if out is None and solved is None:
        raise UsageError("neither --out nor --solved", "a folder to write to", "add --out DATASET")
    extra = _asked_for(column) if column else ()
    folder = solved or Path(f"{out}.solved")
    skin = read_sensor(sensor) if sensor else default_sensor()
    simulation = Simulation(folder, read_simulation_plan(plan or DEFAULT), skin, seed, mesh_error)
    devices = chosen_devices(device)
    simulation.check()
    simulation.open()
    missing = presses - len({n for n in simulation.settled if n < presses})
    count = max(1, min(workers or (cores() if devices == ("cpu",) else len(devices)), missing))
    failed: Counter[str] = Counter()
    began = time.monotonic()
    with bars() as bar:
        task = bar.add_task("solving presses", total=missing)

        def settled(number: int, reason: str) -> None:
            failed.update([reason] if reason else [])
            bar.update(task, advance=1)

        if missing:
            solve_all(simulation, presses, devices, count, settled)
    hours = (time.monotonic() - began) / 3600
    if missing:
        print(f"presses solved: {missing - failed.total()}, given up: {failed.total()}; {missing / hours:.0f} an hour")
    for reason, times in failed.most_common(3):
        print(f"  given up {times} times: {reason.splitlines()[0]}")
    if failed.total() == presses:
        raise SolveError("none of the presses has an equilibrium", "presses that the skin can take", "narrow the plan")
    figures = {"solved": folder, "presses": presses, "new": missing, "given_up": failed.total()}
    if out is None:
        return Result(figures)
    from label_farm.simulated.packing import write_dataset  # here: a computer that only solves needs no recorder

    with bars() as bar:
        task = bar.add_task("writing episodes", total=presses)
        episodes, total = write_dataset(simulation, presses, out, extra, lambda number: bar.update(task, advance=1))
    print(f"simulated dataset: {episodes} episodes, {total} frames, {len(simulation.specimens)} specimens in {out}")
    say(f"solved presses stay in {folder}")
    suggest("train", out, "--out NETWORK")
    return Result({**figures, "dataset": out, "episodes": episodes, "frames": total})


def _asked_for(names: list[str]) -> tuple[str, ...]:
    from tacdata.dataset.format import features

    return features.asked_for(names)
