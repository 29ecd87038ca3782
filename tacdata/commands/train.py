"""Train a network on a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import PIPELINE, Result
from tacdata.progress import bars, suggest

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
    idle_share: Annotated[float, typer.Option(help="Share of the frames out of contact an epoch takes.")] = 1.0,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most.")] = None,
    batch_size: Annotated[int, typer.Option(min=1, help="Frames a step.")] = 32,
    learning_rate: Annotated[float, typer.Option(help="AdamW's step size.")] = 1e-3,
    schedule: Annotated[str, typer.Option(help="Course of the learning rate: constant or cosine.")] = "constant",
    mirror: Annotated[
        bool, typer.Option("--mirror", help="Mirror frames at random, as the sensor is symmetric.")
    ] = False,
    gain_jitter: Annotated[
        float, typer.Option(help="Vary each channel's gain at random by this share, for other specimens.")
    ] = 0.0,
    precision: Annotated[str, typer.Option(help="float32 or bfloat16, for cards.")] = "float32",
    compiled: Annotated[bool, typer.Option("--compile", help="Let torch compile the network; for cards.")] = False,
    tensorboard: Annotated[bool, typer.Option("--tensorboard", help="Metrics for TensorBoard too, in RUN.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the run's last epoch.")] = False,
) -> Result:
    """Train a network that maps taxel signals to depth maps; keeps the best and the last epoch.

    The same dataset, options and machine give the same network. Ctrl-C keeps all finished epochs; --resume
    goes on from there.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    from training.frames.data import read_frames
    from training.settings import TrainingSettings
    from training.tensorboard import event_log
    from training.train import METRICS, train

    settings = TrainingSettings(
        network=network, split=split, seed=seed, epochs=epochs, batch_size=batch_size, learning_rate=learning_rate,
        schedule=schedule, mirror=mirror, gain_jitter=gain_jitter, idle_share=idle_share, precision=precision,
    )  # fmt: skip
    frames = read_frames(dataset)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    log = event_log(out) if tensorboard else lambda progress: None
    with bars(*columns) as bar:
        show = _listener(bar)

        def listen(progress: Progress) -> None:
            show(progress)
            log(progress)

        best = train(frames, settings, out, device, resume, threads, listen, compiled)
    document = best.document
    parts = ", ".join(f"{len(document['split'][part])} {part}" for part in ("train", "validation", "test"))
    print(f"episodes: {parts} (split {document['split']['name']!r})")
    print(f"best epoch {document['epoch']}: validation loss {document['best']['validation_loss']:.5f}")
    print(f"checkpoint {best.path}\nmetrics    {out / METRICS}")
    suggest("evaluate", out)
    return Result({**document, "checkpoint": best.path})


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
