"""Score a trained network."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import PIPELINE, Result

ORDER = 60
PANEL = PIPELINE


def run(
    network: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a training run, or a checkpoint file.")],
    dataset: Annotated[
        Path | None, typer.Option(help="Dataset folder; default: the one that the network was trained on.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the scores; default: RUN/scores, predictions in RUN/predictions.")
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
) -> Result:
    """Score a network on its test episodes (or on another dataset): table, JSON, picture, predictions.

    On the dataset that it was trained on only the test episodes count; another dataset counts as a whole.
    """
    from tacdata.dataset.reader import read_dataset
    from tacdata.errors import UsageError
    from training.frames.data import frames_of
    from training.inference import checkpoint
    from training.reports import report
    from training.reports.score_sheet import markdown
    from training.scoring.evaluate import evaluate

    place = report.places(network, out)
    place.check()
    trained = checkpoint.load(network)
    recorded = Path(trained.document["dataset"]["path"])
    if dataset is None and not recorded.is_dir():
        raise UsageError(f"the dataset {recorded} of {network} is not there", "a dataset folder", "give --dataset")
    scored = read_dataset(dataset or recorded)
    frames = frames_of(scored)
    with progress.bars(transient=True) as bar:
        task = bar.add_task("predict", total=None)
        evaluation = evaluate(
            trained, frames, device, threads, lambda done, total: bar.update(task, completed=done, total=total)
        )
        report.write(place, evaluation, frames)
    print(markdown(evaluation.document))
    if scored.simulated:
        print("simulated: the scores say how well the network knows the skin model; of a sensor they say nothing")
    print(f"scores      {place.scores / report.JSON}, {report.SHEET}, {report.PICTURE}")
    print(f"predictions {place.predictions}")
    return Result(evaluation.document)
