"""Train a network on a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tacdata.commands.command import LEARN, Result
from tacdata.progress import bars, suggest

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.progress import Progress as Bar

    from tacdata.training.inference.checkpoint import Checkpoint
    from tacdata.training.train import Progress

ORDER = 10
PANEL = LEARN
EXAMPLES = (
    "tacdata train dataset --network pattern --out network",
    "tacdata train dataset --from shipped --out network",
    "tacdata train dataset --out network --resume",
)


def run(
    dataset: Annotated[Path, typer.Argument(help="Dataset folder.")],
    out: Annotated[Path, typer.Option(help="Folder of the run; must not exist yet.")],
    epochs: Annotated[int | None, typer.Option(help="Passes over the frames; default 50, or 20 with --from.")] = None,
    network: Annotated[str | None, typer.Option(help="A file name in training/networks; default: paper.")] = None,
    start: Annotated[
        str | None, typer.Option("--from", help="Start from a pretrained checkpoint, or from `shipped`.")
    ] = None,
    simulated: Annotated[
        Path | None, typer.Option(help="Mix in frames of a dataset that `tacdata simulate` made.")
    ] = None,
    split: Annotated[str, typer.Option(help="A file name in training/splits.")] = "episode",
    seed: Annotated[int, typer.Option(help="Seed of the split, the weights and the order of frames.")] = 0,
    idle_share: Annotated[
        float | None, typer.Option(help="Share of the frames out of contact an epoch takes; default 1.")
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu, cuda or cuda:N.")] = "auto",
    threads: Annotated[
        int | None, typer.Option(min=1, help="CPU threads; default: one a core, 4 at most; one with --from.")
    ] = None,
    batch_size: Annotated[int | None, typer.Option(min=1, help="Frames a step; default 32.")] = None,
    learning_rate: Annotated[float | None, typer.Option(help="AdamW's step size; default 0.001.")] = None,
    schedule: Annotated[str | None, typer.Option(help="Course of the learning rate: constant or cosine.")] = None,
    mirror: Annotated[
        bool | None, typer.Option("--mirror/--no-mirror", help="Mirror frames at random: the sensor is symmetric.")
    ] = None,
    calibrate: Annotated[
        bool | None, typer.Option("--calibrate/--no-calibrate", help="Turn readings into forces first.")
    ] = None,
    gain_jitter: Annotated[float | None, typer.Option(help="Vary each channel's gain at random by this share.")] = None,
    scale_jitter: Annotated[float | None, typer.Option(help="Vary the common gain at random by this share.")] = None,
    exponent_jitter: Annotated[float | None, typer.Option(help="Vary the exponent at random by this much.")] = None,
    spread_jitter: Annotated[
        float | None, typer.Option(help="Vary how far loads spread at random, by this variance [mm²].")
    ] = None,
    precision: Annotated[str, typer.Option(help="float32 or bfloat16, for cards.")] = "float32",
    compiled: Annotated[bool, typer.Option("--compile", help="Let torch compile the network; for cards.")] = False,
    leave_out: Annotated[
        int | None, typer.Option("--leave-out", help="Intervals for unseen shapes: groups of shapes left out in turn.")
    ] = None,
    tensorboard: Annotated[bool, typer.Option("--tensorboard", help="Metrics for TensorBoard too, in RUN.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the run's last epoch.")] = False,
) -> Result:
    """Train a network that maps taxel signals to depth maps; keeps the best and the last epoch.

    Options left out are those of the paper, or those that suit the network (`training/networks`). With --from, a
    pretrained network is calibrated to the unit and trained on: a few recorded presses are enough. The same dataset,
    options and machine give the same network. With --leave-out, the pixels' intervals hold on unseen shapes. Ctrl-C
    keeps all finished epochs; --resume goes on from there.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    import tacdata as td
    from tacdata.training.train import METRICS

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with bars(*columns) as bar:
        trained = td.train(
            dataset,
            out,
            start=start,
            simulated=simulated,
            device=device,
            threads=threads,
            compiled=compiled,
            leave_out=leave_out,
            tensorboard=tensorboard,
            resume=resume,
            progress=_listener(bar),
            network=network,
            split=split,
            seed=seed,
            epochs=epochs,
            batch_size=batch_size,
            learning_rate=learning_rate,
            schedule=schedule,
            mirror=mirror,
            calibrate=calibrate,
            gain_jitter=gain_jitter,
            scale_jitter=scale_jitter,
            exponent_jitter=exponent_jitter,
            spread_jitter=spread_jitter,
            idle_share=idle_share,
            precision=precision,
        )
    best = trained.checkpoint
    document = best.document
    parts = ", ".join(f"{len(document['split'][part])} {part}" for part in ("train", "validation", "test"))
    print(f"episodes: {parts} (split {document['split']['name']!r})")
    _say_calibration(best, dataset)
    if "cross_fit" in document:
        left_out, share = (document["cross_fit"][name] for name in ("left_out", "share"))
        print(f"fit: {sum(map(len, left_out))} presses left out in turn; weights moved by {share:g} (0: none)")
    print(f"best epoch {document['epoch']}: validation loss {document['best']['validation_loss']:.5f}")
    print(f"checkpoint {best.path}\nmetrics    {out / METRICS}")
    suggest("evaluate", out)
    return Result({**document, "checkpoint": best.path})


def _say_calibration(best: Checkpoint, dataset: Path) -> None:
    """Print the calibration of readings to forces, and its undetermined quantities."""
    import numpy as np

    from tacdata.training.frames.channel_calibration import doubts
    from tacdata.training.frames.data import read_frames

    calibration = best.calibration
    if not calibration:
        return
    # The median: one channel at the rim, which few presses reach, is known far worse than the others.
    mean, error = calibration.gain.mean(), float(np.median(calibration.gain_error / calibration.gain))
    print(
        f"calibration: {mean:.3g} N at 1000 counts, each channel to {100 * error:.0f} %; "
        f"exponent {calibration.exponent:.2f} ± {calibration.exponent_error:.2f}; {calibration.presses} presses"
    )
    if calibration.mixing is not None:
        wider = "farther" if calibration.spread >= 0 else "less far"
        print(
            f"the model spreads a load {wider} than this skin, and its forces are spread in the same way: variance "
            f"{calibration.spread:+.2f} ± {calibration.spread_error:.2f} mm²"
        )
    for words in doubts(calibration, read_frames(dataset), best.split.train):
        print(f"note: {words}")


def _listener(bar: Bar) -> Callable[[Progress], None]:
    """Return the progress display of a run: a bar for the epochs, one for the steps, a line an epoch."""
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
            f"epoch {line['epoch']:3d} of {progress.epochs}  train loss {line['train_loss']:.5f}  "
            f"validation loss {line['validation_loss']:.5f}, {words}"
        )

    return show
