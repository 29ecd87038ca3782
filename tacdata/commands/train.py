"""Train a network on a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import PIPELINE

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.progress import Progress as Bar

    from training.train import Progress

ORDER = 50
PANEL = PIPELINE


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder.")],
    out: Annotated[Path, typer.Option(help="Folder of the run; must not exist yet.")],
    epochs: Annotated[int, typer.Option(help="Passes over the training frames.")] = 50,
    network: Annotated[str, typer.Option(help="A file name in training/networks.")] = "paper",
    split: Annotated[str, typer.Option(help="A file name in training/splits.")] = "episode",
    seed: Annotated[int, typer.Option(help="Seed of the split, the weights and the order of frames.")] = 0,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the run's last epoch.")] = False,
) -> None:
    """Train a network that maps taxel signals to depth maps; keeps the best and the last epoch.

    The same dataset, options and machine give the same network. Ctrl-C keeps all finished epochs; --resume
    goes on from there.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    from training.data import read_frames
    from training.settings import Settings
    from training.train import METRICS, train

    settings = Settings(network=network, split=split, seed=seed, epochs=epochs)
    frames = read_frames(dataset)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Bar(*columns) as bar:
        best = train(frames, settings, out, device, resume, threads, _listener(bar))
    document = best.document
    parts = ", ".join(f"{len(document['split'][part])} {part}" for part in ("train", "validation", "test"))
    print(f"episodes: {parts} (split {document['split']['name']!r})")
    print(f"best epoch {document['epoch']}: validation loss {document['best']['validation_loss']:.5f}")
    print(f"checkpoint {best.path}\nmetrics    {out / METRICS}\nnext: tacdata evaluate {out}")


def _listener(bar: Bar) -> Callable[[Progress], None]:
    """Return what shows the progress of a run: a bar for the epochs, one for the steps, a line an epoch."""
    epochs, steps = bar.add_task("epochs", total=None), bar.add_task("steps ", total=None)

    def show(progress: Progress) -> None:
        if progress.finished is None:
            bar.update(epochs, total=progress.epochs, completed=progress.epoch - 1)
            bar.update(steps, total=progress.steps, completed=progress.step)
            return
        line = progress.finished
        bar.update(epochs, total=progress.epochs, completed=progress.epoch)
        error = line["validation_contact_rmse_mm"]
        words = "no contact" if error is None else f"contact RMSE {error:.3f} mm"
        bar.print(
            f"epoch {line['epoch']:3d}  train loss {line['train_loss']:.5f}  "
            f"validation loss {line['validation_loss']:.5f}, {words}"
        )

    return show
