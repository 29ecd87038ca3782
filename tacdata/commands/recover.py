"""`tacdata recover`."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import RECORD, Result
from tacdata.errors import Exit

ORDER = 50
PANEL = RECORD
EXAMPLES = (
    "tacdata recover session/episode-000003.partial.mcap",
    "tacdata recover cut.mcap --out whole.mcap",
    "tacdata recover cut.mcap --json",
)


def run(
    file: Annotated[Path, typer.Argument(help="The damaged recording (MCAP).")],
    out: Annotated[Path | None, typer.Option(help="Where to write the repaired copy; default: next to it.")] = None,
) -> Result:
    """Write a repaired copy of a recording that a crash cut off: 0 if all is there, 3 with a loss, 1 if nothing is."""
    from tacdata.recording.files.recover import recover

    result = recover(file, out)
    for damage in result.damage or ["nothing was wrong with it"]:
        print(f"{file.name}: {damage}")
    print(f"{result.messages} messages and {result.attachments} attachments are in {result.path}")
    return Result(result, Exit.FORMAT if result.damage else Exit.DONE)
