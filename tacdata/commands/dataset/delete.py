"""Leave episodes out of a dataset."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.progress import suggest

ORDER = 20
EXAMPLES = (
    "tacdata dataset delete dataset --episodes 3,7-9 --out fewer",
    "tacdata dataset delete dataset --episodes 0 --out later",
    "tacdata dataset delete dataset --episodes 5-9 --out half --json",
)


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset; it stays as it is.")],
    episodes: Annotated[str, typer.Option(help="Episodes to leave out, such as 0-4,7.")],
    out: Annotated[Path, typer.Option(help="Folder of the new dataset; must not exist.")],
) -> Result:
    """Write a dataset without some of its episodes, by lerobot's tool, with sensors and records kept."""
    from tacdata.commands.dataset.command import counted, lacking, numbers
    from tacdata.dataset.edit import delete

    indices = numbers(episodes)
    missing = delete(dataset, indices, out)
    print(f"{out}: {dataset} without {counted(set(indices))}; the others have new numbers{lacking(missing)}")
    suggest("card", out)
    return Result({"dataset": out, "without_record": missing})
