"""Write the labelled recordings of a session as a LeRobot dataset."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.progress import say, suggest

ORDER = 60
PANEL = DATA
EXAMPLES = (
    "tacdata pack session --out dataset",
    "tacdata pack tuesday --out dataset --append",
    "tacdata pack session --labels relabelled --out dataset",
)


def run(
    session: Annotated[Path, typer.Argument(help="Folder of recordings, from `tacdata record`.")],
    out: Annotated[Path, typer.Option(help="Folder of the dataset; must not exist, unless --append.")],
    labels: Annotated[Path | None, typer.Option(help="Folder of labels; without it SESSION/labels.")] = None,
    append: Annotated[bool, typer.Option("--append", help="Add to the dataset what it does not hold.")] = False,
    sensor: Annotated[Path | None, typer.Option(help="Sensor file of the labels, if not the recorded one.")] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(help="Column of the labels to carry along, such as uncertainty (mm a pixel); give it repeatedly."),
    ] = None,
    model: Annotated[str | None, typer.Option(help="Content hash of the skin model to insist on.")] = None,
) -> Result:
    """Write the recordings and their labels as a LeRobot v3 dataset."""
    import tacdata as td

    def show(episode: td.Episode, reason: str) -> None:
        say(f"  {episode.path.name}  " + (f"left out: {reason}" if reason else "packed"))

    packed = td.pack(
        session, out, labels=labels, append=append, sensor=sensor, columns=column or (), model=model, progress=show
    )
    for name, reason in packed.failures.items():
        print(f"  {name} has no label because: {reason}")
    for name in packed.unfinished:
        print(f"  {name}  left out: the recording was interrupted")
    for flag in packed.flags:
        print(f"  {flag.file}  set aside, training leaves it out: {flag.reason}")
    if packed.notes:
        print(f"  {packed.notes} notes on stretches copied")
    print(f"{packed.episodes} episodes, {packed.frames} frames in {out}")
    suggest("train", out)
    return Result(packed)
