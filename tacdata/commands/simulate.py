"""Make a dataset of simulated presses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.progress import StageBars, say, suggest

if TYPE_CHECKING:
    from tacdata.pipeline.simulate import SimulatedPresses

ORDER = 90
PANEL = DATA
EXAMPLES = (
    "tacdata simulate --presses 100 --out simulated",
    "tacdata simulate plan.yaml --out simulated --workers 2",
    "tacdata simulate --presses 50 --effects effects.json --out worn",
)
PAUSE = 30.0
"""Time between two lines of progress where there is no terminal [s]."""


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
        typer.Option(
            help="Verdict or model spec whose effects are laid over the readings, in addition to the plan's own."
        ),
    ] = None,
    column: Annotated[
        list[str] | None, typer.Option(help="Column of the labels to carry along, such as error_map (mm a pixel).")
    ] = None,
) -> Result:
    """Make a dataset of random presses by the skin model; stopped and run again, it goes on.

    The dataset is marked as simulated. Solved presses stay in their folder; other noise reuses them.
    """
    import tacdata as td

    with StageBars(PAUSE) as bars:
        done = td.simulate(
            out,
            presses,
            plan=plan,
            seed=seed,
            sensor=sensor,
            solved=solved,
            device=device,
            workers=workers,
            mesh_error=mesh_error,
            effects=effects or (),
            columns=column or (),
            progress=bars.show,
        )
    if done.new:
        _report(done, bars.solving_seconds)
    figures = {"solved": done.solved, "presses": presses, "new": done.new, "given_up": done.given_up.total()}
    if out is None:
        return Result(figures)
    if done.left_out:
        say(f"left out: {done.left_out.total()} solved presses; {done.left_out.most_common(1)[0][0]}")
        say("an older release may have solved them: to have them too, solve them again into another --solved folder")
    print(f"simulated dataset: {done.episodes} episodes, {done.frames} frames, {done.specimens} specimens in {out}")
    say(f"solved presses stay in {done.solved}")
    suggest("train", out, "--out NETWORK")
    left_out = done.left_out.total()
    return Result({**figures, "dataset": out, "episodes": done.episodes, "frames": done.frames, "left_out": left_out})


def _report(done: SimulatedPresses, seconds: float) -> None:
    """Print how many presses were solved, how fast, and why others were given up."""
    lost = done.given_up.total()
    print(f"presses solved: {done.new - lost}, given up: {lost}; {done.new / seconds * 3600:.0f} an hour")
    for reason, times in done.given_up.most_common(3):
        print(f"  given up {times} times: {reason.splitlines()[0]}")
