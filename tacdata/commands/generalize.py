"""Train and score a network on every way to hold presses out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import LEARN, Result
from tacdata.errors import UsageError
from tacdata.progress import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from tacdata.training.settings import TrainingSettings
    from tacdata.training.train import Progress

ORDER = 50
PANEL = LEARN
EXAMPLES = (
    "tacdata generalize dataset --out generalize",
    "tacdata generalize dataset --split shape --split depth --out generalize",
    "tacdata generalize dataset --network pattern --seeds 3 --out generalize",
)
REPORT = "report.html"


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder.")],
    out: Annotated[Path, typer.Option(help="Folder of the runs; run again, it goes on.")],
    network: Annotated[str, typer.Option(help="A file name in training/networks.")] = "paper",
    split: Annotated[
        list[str] | None, typer.Option(help="A file name in training/splits; repeat for several. Default: all.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds of each split.")] = 1,
    epochs: Annotated[int, typer.Option(min=1, help="Passes over the training frames.")] = 50,
    batch_size: Annotated[int, typer.Option(min=1, help="Frames a step.")] = 32,
    learning_rate: Annotated[float, typer.Option(help="AdamW's step size.")] = 1e-3,
    schedule: Annotated[str, typer.Option(help="Course of the learning rate: constant or cosine.")] = "constant",
    mirror: Annotated[bool, typer.Option("--mirror", help="Mirror frames at random.")] = False,
    gain_jitter: Annotated[float, typer.Option(help="Vary each channel's gain at random by this share.")] = 0.0,
    idle_share: Annotated[float, typer.Option(help="Share of the frames out of contact an epoch takes.")] = 1.0,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
) -> Result:
    """Hold out episodes, shapes, sites, depths, rates and specimens in turn; train, score, and report them together.

    A split that the dataset does not allow, for example by specimen where there is one, is named with the reason.
    """
    from tacdata import documents
    from tacdata.training.frames.data import read_frames
    from tacdata.training.generalization import DEFAULTS, generalize, run_name
    from tacdata.training.reports.report_page import Scored, page
    from tacdata.training.settings import TrainingSettings
    from tacdata.training.splits.split import describe

    recipe = TrainingSettings(
        network=network,
        epochs=epochs,
        batch_size=batch_size,
        learning_rate=learning_rate,
        schedule=schedule,
        mirror=mirror,
        gain_jitter=gain_jitter,
        idle_share=idle_share,
    )
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file", "a folder", "choose another --out")
    splits = tuple(split or DEFAULTS)
    # An unknown split ends the verb here and not after hours of training.
    for name in splits:
        describe(name)
    frames = read_frames(dataset)
    outcomes = generalize(frames, recipe, splits, seeds, out, device, threads, _announced)
    runs = [Scored(o.settings.title, o.evaluation, frames) for o in outcomes if o.evaluation]
    impossible = {o.settings.split: o.reason for o in outcomes if not o.evaluation}
    documents.write_text(out / REPORT, page(runs, impossible=impossible))
    for outcome in outcomes:
        if outcome.evaluation:
            table = outcome.evaluation.document["contact_frames"]
            figures = [table[m]["mean"] for m in ("contact_rmse", "centroid_error", "iou")]
            words = "no contact" if None in figures else "{:.3f} mm, {:.3f} px, IoU {:.3f}".format(*figures)
            print(f"{run_name(outcome.settings):<32} {words}")
    for name, reason in impossible.items():
        print(f"split {name} is not possible: {reason}")
    print(f"report: {out / REPORT}")
    scores = {run_name(o.settings): o.evaluation.document for o in outcomes if o.evaluation}
    return Result({"runs": scores, "not_possible": impossible, "report": out / REPORT})


def _announced(settings: TrainingSettings) -> Callable[[Progress], None]:
    say(f"split {settings.split}, seed {settings.seed}:")

    def show(progress: Progress) -> None:
        line = progress.finished
        if line and (line["epoch"] % 10 == 0 or line["epoch"] == progress.epochs):
            say(f"  epoch {line['epoch']} of {progress.epochs}, validation loss {line['validation_loss']:.5f}")

    return show
