"""Write a dataset's data card."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import DATA, Result

ORDER = 70
PANEL = DATA
EXAMPLES = ("tacdata card dataset", "tacdata card dataset --out card", "tacdata card dataset --json")


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder.")],
    out: Annotated[
        Path | None, typer.Option(help="New folder for card.md and coverage.png; else only printed.")
    ] = None,
) -> Result:
    """Summarize a dataset: sensor, indenters, coverage, model version, origin of the labels, known gaps."""
    from tacdata import documents
    from tacdata.dataset import card, coverage_picture
    from tacdata.dataset.reader import read_dataset
    from tacdata.errors import UsageError

    if out and out.exists():
        raise UsageError(f"{out} exists", "a new folder; nothing is overwritten", "choose another --out")
    opened = read_dataset(dataset)
    text = card.card(opened)
    print(text)
    if out:
        documents.write_text(out / "card.md", text)
        coverage_picture.draw(out / card.PICTURE, opened)
        print(f"written: {out / 'card.md'}, {card.PICTURE}")
    return Result(card.document(opened))
