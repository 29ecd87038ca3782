"""Write datasets below each other as one."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.progress import suggest

ORDER = 40
EXAMPLES = (
    "tacdata dataset merge monday tuesday --out both",
    "tacdata dataset merge a b c --out all",
    "tacdata dataset merge monday tuesday --out both --json",
)


def run(
    datasets: Annotated[list[Path], typer.Argument(help="Datasets, in the order of their episodes.")],
    out: Annotated[Path, typer.Option(help="Folder of the new dataset; must not exist.")],
) -> Result:
    """Write datasets below each other as one, by lerobot's tool, with sensors and records kept."""
    from tacdata.commands.dataset.command import lacking
    from tacdata.dataset.edit import merge

    missing = merge(datasets, out)
    print(f"{out}: {len(datasets)} datasets in one{lacking(missing)}")
    suggest("card", out)
    return Result({"dataset": out, "without_record": missing})
