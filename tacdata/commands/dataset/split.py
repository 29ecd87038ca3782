"""Write parts of a dataset as datasets."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import Result
from tacdata.errors import UsageError
from tacdata.progress import suggest

ORDER = 30
EXAMPLES = (
    "tacdata dataset split dataset --part train=0-15 --part test=16-19 --out parts",
    "tacdata dataset split dataset --part first=0-9 --out parts",
    "tacdata dataset split dataset --part odd=1,3,5 --out parts --json",
)


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset; it stays as it is.")],
    part: Annotated[list[str], typer.Option(help="A part, such as train=0-7,9; give it for each.")],
    out: Annotated[Path, typer.Option(help="New folder, with a folder for each part in it.")],
) -> Result:
    """Write parts of a dataset as datasets of their own, by lerobot's tool, with sensors and records kept."""
    from tacdata.commands.dataset.command import counted, lacking, numbers
    from tacdata.dataset.edit import split

    parts: dict[str, list[int]] = {}
    for entry in part:
        name, equals, listed = entry.partition("=")
        if not equals or name in parts:
            raise UsageError(
                f"--part {entry}", "another name for each part, and its episodes", "type it as --part train=0-7"
            )
        parts[name] = numbers(listed)
    missing = split(dataset, parts, out)
    for name, indices in parts.items():
        print(f"{out / name}: {counted(indices)}{lacking(missing[name])}")
    suggest("card", out / next(iter(parts)))
    return Result({"datasets": [out / name for name in parts], "without_record": missing})
