"""Say how many recorded presses a network needs, started from a pretrained one and from random weights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import LEARN, Result
from tacdata.errors import UsageError
from tacdata.progress import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from tacdata.training.pretraining.learning_curve import CurvePoint
    from tacdata.training.train import Progress

ORDER = 60
PANEL = LEARN
EXAMPLES = (
    "tacdata learning-curve dataset --out curve",
    "tacdata learning-curve dataset --presses 0,3,10 --out curve",
    "tacdata learning-curve dataset --from none --network history --out curve",
)
PICTURE = "curve.png"
NONE = "none"
"""A start without a pretrained network, for a sensor that has none."""


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder of recorded presses.")],
    out: Annotated[Path, typer.Option(help="Folder of the runs; run again, it goes on.")],
    start: Annotated[str, typer.Option("--from", help="The pretrained checkpoint, `shipped`, or `none`.")] = "shipped",
    presses: Annotated[
        str, typer.Option(help="Numbers of presses, with commas; 0 is the network as it is.")
    ] = "0,3,10,30,100,300",
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of each number.")] = 3,
    network: Annotated[
        list[str] | None, typer.Option(help="Train this network from random weights, too; repeat for several.")
    ] = None,
    simulated: Annotated[
        Path | None, typer.Option(help="Mix in frames of a dataset that `tacdata simulate` made.")
    ] = None,
    split: Annotated[str, typer.Option(help="Which presses are held out: a file name in training/splits.")] = "episode",
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
) -> Result:
    """Draw the learning curve: the error on presses held out, over the number of presses trained on."""
    from tacdata.training.frames.data import read_frames
    from tacdata.training.pretraining.curve_picture import draw, table
    from tacdata.training.pretraining.learning_curve import FILE, learning_curve
    from tacdata.training.pretraining.shipped import pretrained

    try:
        numbers = sorted({int(number) for number in presses.split(",")})
    except ValueError:
        numbers = []
    if not numbers or numbers[0] < 0:
        raise UsageError(f"--presses {presses}", "whole numbers with commas, 0,10,30", "correct the list")
    document = learning_curve(
        read_frames(dataset),
        None if start == NONE else pretrained(start),
        out,
        numbers,
        tuple(range(seeds)),
        split,
        tuple(network or ("pattern",)),
        read_frames(simulated) if simulated else None,
        device,
        threads,
        _told,
        _begun,
    )
    draw(out / PICTURE, document)
    print(table(document))
    print(f"curve   {out / FILE}\npicture {out / PICTURE}")
    return Result({"points": document["points"], "curve": out / FILE, "picture": out / PICTURE})


def _told(point: CurvePoint) -> None:
    say(f"{point.start}, {point.presses} presses, seed {point.seed}: centroid error {point.centroid_error:.2f} px")


def _begun(start: str, presses: int, seed: int) -> Callable[[Progress], None]:
    def show(progress: Progress) -> None:
        line = progress.finished
        if line and line["epoch"] % 10 == 0:
            say(f"  {start}, {presses} presses, seed {seed}: epoch {line['epoch']} of {progress.epochs}")

    return show
