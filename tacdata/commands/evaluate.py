"""Score a trained network."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata import progress
from tacdata.commands.command import LEARN, Result

ORDER = 20
PANEL = LEARN
EXAMPLES = (
    "tacdata evaluate network",
    "tacdata evaluate network --dataset unseen --out scores",
    "tacdata evaluate network --device cpu --json",
)


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
    import tacdata as td
    from tacdata.training.frames.data import frames_of
    from tacdata.training.reports import report
    from tacdata.training.reports.score_sheet import markdown

    place = report.places(network, out)
    place.check()
    trained = td.read_network(network)
    scored = td.read_dataset(dataset or trained.training_folder)
    with progress.bars(transient=True) as bar:
        task = bar.add_task("predict", total=None)
        evaluation = td.evaluate(
            trained,
            scored,
            device=device,
            threads=threads,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
        report.write(place, evaluation, frames_of(scored))
    print(markdown(evaluation.document))
    if scored.simulated:
        print("simulated: the scores say how well the network knows the skin model; of a sensor they say nothing")
    print(f"scores      {place.scores / report.JSON}, {report.SHEET}, {report.PICTURE}")
    print(f"predictions {place.predictions}")
    return Result(evaluation.document)
