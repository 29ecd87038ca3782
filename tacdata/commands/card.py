"""Write a dataset's data card."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import DATA, Result
from tacdata.errors import UsageError

ORDER = 70
PANEL = DATA
EXAMPLES = ("tacdata card dataset", "tacdata card dataset --out card", "tacdata card dataset --push me/presses")


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder.")],
    out: Annotated[
        Path | None, typer.Option(help="New folder for card.md and coverage.png; else only printed.")
    ] = None,
    push: Annotated[
        str | None, typer.Option(metavar="OWNER/NAME", help="Write DATASET/README.md; print the command of the upload.")
    ] = None,
) -> Result:
    """Summarize a dataset: sensor, indenters, coverage, model version, origin of the labels, known gaps."""
    import shlex

    from tacdata import documents
    from tacdata.dataset import card, coverage_picture
    from tacdata.dataset.reader import read_dataset

    if out and out.exists():
        raise UsageError(f"{out} exists", "a new folder; nothing is overwritten", "choose another --out")
    if push and (dataset / card.HUB).exists():
        raise UsageError(f"{dataset / card.HUB} exists", "no such file; nothing is overwritten", "move it away")
    opened = read_dataset(dataset)
    text = card.card(opened)
    print(text)
    if out:
        documents.write_text(out / "card.md", text)
        coverage_picture.draw(out / card.PICTURE, opened)
        print(f"written: {out / 'card.md'}, {card.PICTURE}")
    if push:
        documents.write_text(dataset / card.HUB, card.HUB_HEAD + text)
        print(f"written: {dataset / card.HUB}")
        print(f"next: hf upload {shlex.quote(push)} {shlex.quote(str(dataset))} . --repo-type dataset")
    return Result(card.document(opened))
