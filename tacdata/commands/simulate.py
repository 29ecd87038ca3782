"""Make a dataset of simulated presses."""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import PIPELINE, Result
from tacdata.progress import bars, say, suggest

ORDER = 45
PANEL = PIPELINE
SAY_SECONDS = 30.0
"""Seconds between two lines of progress where there is no terminal."""


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
    effects: Annotated[
        list[Path] | None,
        typer.Option(help="Verdict or model spec whose effects are laid over the readings, beside the plan's own."),
    ] = None,
    column: Annotated[
        list[str] | None, typer.Option(help="Column of the labels to carry along, such as error_map (mm a pixel).")
    ] = None,
) -> Result:
    """Make a dataset of random presses by the skin model; stopped and run again, it goes on.

    The dataset is marked as simulated. Solved presses stay in their folder: more presses or other noise reuse them.
    """
    from label_farm.environment import cores
    from label_farm.simulated.crew import chosen_devices, solve_all
    from label_farm.simulated.plan import DEFAULT, read_simulation_plan
    from label_farm.simulated.press_effects import effects_of, with_effects
    from label_farm.simulated.simulation import Simulation
    from tacdata.errors import SolveError, UsageError
    from tacdata.sensor import default_sensor, read_sensor

    if out is None and solved is None:
        raise UsageError("neither --out nor --solved", "a folder to write to", "add --out DATASET")
    extra = _asked_for(column) if column else ()
    folder = solved or Path(f"{out}.solved")
    skin = read_sensor(sensor) if sensor else default_sensor()
    drawn = read_simulation_plan(plan or DEFAULT)
    for path in effects or ():
        drawn = with_effects(drawn, effects_of(path))
    simulation = Simulation(folder, drawn, skin, seed, mesh_error)
    devices = chosen_devices(device)
    simulation.check()
    simulation.open()
    missing = presses - len({n for n in simulation.settled if n < presses})
    count = max(1, min(workers or (cores() if devices == ("cpu",) else len(devices)), missing))
    solving = _Solving(missing)
    if missing:
        with solving:
            solve_all(simulation, presses, devices, count, solving.settled)
        solving.report()
    given_up = solving.failed.total()
    if given_up == presses:
        raise SolveError("none of the presses has an equilibrium", "presses that the skin can take", "narrow the plan")
    figures = {"solved": folder, "presses": presses, "new": missing, "given_up": given_up}
    if out is None:
        return Result(figures)
    from label_farm.simulated.packing import write_dataset  # here: a computer that only solves needs no recorder

    left_out = Counter[str]()
    with bars() as bar:
        task = bar.add_task("writing episodes", total=presses)

        def done(number: int, reason: str) -> None:
            left_out.update([reason] if reason else [])
            bar.update(task, advance=1)

        episodes, total = write_dataset(simulation, presses, out, extra, done)
    if not total:
        raise SolveError(
            f"none of {presses} presses is left: {left_out.most_common(1)[0][0]}",
            "presses that the skin can take",
            "solve anew into another --solved folder, or narrow the plan",
        )
    if left_out:
        say(f"left out: {left_out.total()} solved presses; {left_out.most_common(1)[0][0]}")
        say("an older release may have solved them: to have them too, solve anew into another --solved folder")
    print(f"simulated dataset: {episodes} episodes, {total} frames, {len(simulation.specimens)} specimens in {out}")
    say(f"solved presses stay in {folder}")
    suggest("train", out, "--out NETWORK")
    return Result({**figures, "dataset": out, "episodes": episodes, "frames": total, "left_out": left_out.total()})


class _Solving:
    """A bar with the time that remains; a line now and then where there is no terminal."""

    def __init__(self, presses: int) -> None:
        self.failed: Counter[str] = Counter()
        self._presses, self._done = presses, 0
        self._bar = bars(speed_estimate_period=24 * 3600.0)

    def __enter__(self) -> None:
        self._began = self._said = time.monotonic()
        self._task = self._bar.add_task("solving presses", total=self._presses)
        if sys.stdout.isatty():
            self._bar.start()

    def __exit__(self, *exception: object) -> None:
        self._bar.stop()

    def settled(self, number: int, reason: str) -> None:
        """Count a press that is solved or given up."""
        self._done += 1
        self.failed.update([reason] if reason else [])
        self._bar.update(self._task, completed=self._done)
        if not sys.stdout.isatty() and time.monotonic() - self._said > SAY_SECONDS:
            self._said = time.monotonic()
            left = (self._said - self._began) * (self._presses - self._done) / self._done
            say(f"  press {self._done} of {self._presses} solved, about {left / 60:.0f} min left")

    def report(self) -> None:
        """Say how many were solved, how fast, and why others were given up."""
        hours, lost = (time.monotonic() - self._began) / 3600, self.failed.total()
        print(f"presses solved: {self._presses - lost}, given up: {lost}; {self._presses / hours:.0f} an hour")
        for reason, times in self.failed.most_common(3):
            print(f"  given up {times} times: {reason.splitlines()[0]}")


def _asked_for(names: list[str]) -> tuple[str, ...]:
    from tacdata.dataset.format import features

    return features.asked_for(names)
