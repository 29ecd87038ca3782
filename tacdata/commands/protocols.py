"""Recreate the paper's configuration-referenced evaluations on a dataset of trials."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import LEARN, Result
from tacdata.errors import UsageError

ORDER = 40
PANEL = LEARN
EXAMPLES = (
    "tacdata protocols trials",
    "tacdata protocols trials --network network",
    "tacdata protocols trials --network network --out protocols",
)
JSON, SHEET = "protocols.json", "protocols.md"


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset of the trials, recorded separately from training.")],
    network: Annotated[
        Path | None, typer.Option(help="Training run or checkpoint; without it only the labels are evaluated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="New folder for protocols.json and protocols.md.")] = None,
) -> Result:
    """Evaluate labels and predictions against the prescribed contact, with the paper's rows for comparison.

    The plan that `tacdata plan evaluation` writes holds 78 depth and 40 position trials; presses whose purpose is
    "wearing trial" are scored by participant. If no press of the dataset has a purpose, each has both.
    """
    from tacdata import documents
    from tacdata.dataset.reader import read_dataset
    from tacdata.training.frames.data import frames_of
    from tacdata.training.inference import checkpoint
    from tacdata.training.reports.protocol_sheet import markdown
    from tacdata.training.scoring.protocols import protocols

    if out and out.exists():
        raise UsageError(f"{out} exists", "a new folder; nothing is overwritten", "choose another --out")
    trained = checkpoint.load(network) if network else None
    trials = read_dataset(dataset)
    trials.check_measured("the paper's trials")
    document = protocols(frames_of(trials), trained)
    documents.check(document, "protocols", str(dataset))
    print(markdown(document))
    if out:
        documents.write_text(out / SHEET, markdown(document))
        documents.write(out / JSON, document, "protocols")
        print(f"written: {out / JSON}, {SHEET}")
    return Result(document)
