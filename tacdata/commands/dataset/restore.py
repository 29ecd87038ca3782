"""Restore fields that lerobot's edit tools dropped."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.progress import suggest

ORDER = 10
EXAMPLES = (
    "tacdata dataset restore edited dataset",
    "tacdata dataset restore merged monday tuesday",
    "tacdata dataset restore edited dataset --json",
)


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset that another tool edited.")],
    sources: Annotated[list[Path], typer.Argument(help="Datasets that it was made from.")],
) -> Result:
    """Put sensors, units and records back into a dataset that lerobot deleted from, split or merged."""
    from tacdata.commands.dataset.command import lacking
    from tacdata.dataset.restore import restore

    missing = restore(dataset, sources)
    print(f"{dataset}: sensors and units are back{lacking(missing)}")
    suggest("card", dataset)
    return Result({"dataset": dataset, "without_record": missing})
