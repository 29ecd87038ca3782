"""A network trained on a dataset."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TypedDict, Unpack

from tacdata.paths import StrPath
from tacdata.pipeline.trained_network import TrainedNetwork
from tacdata.training.frames.data import read_frames
from tacdata.training.pretraining.cross_fit import fit
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.pretraining.shipped import pretrained
from tacdata.training.pretraining.unseen_shapes import calibrate_on_unseen_shapes
from tacdata.training.tensorboard import event_log
from tacdata.training.train import Progress
from tacdata.training.train import train as train_on_frames


class TrainingOptions(TypedDict, total=False):
    """Settings of a run; those that are left out, or None, are the paper's, or suit the network."""

    network: str | None
    """Architecture: a file name in `training/networks`."""
    split: str
    """Division into training, validation and test: a file name in `training/splits`."""
    seed: int
    """Seed of the split, the weights and the order of frames."""
    epochs: int | None
    """Passes over the frames."""
    batch_size: int | None
    """Frames a step."""
    learning_rate: float | None
    """Step size of AdamW."""
    schedule: str | None
    """Course of the learning rate: "constant" or "cosine"."""
    mirror: bool | None
    """Whether frames are mirrored at random: the sensor is symmetric."""
    calibrate: bool | None
    """Whether readings become forces first."""
    gain_jitter: float | None
    """Random change of each channel's gain [1]."""
    scale_jitter: float | None
    """Random change of the common gain [1]."""
    exponent_jitter: float | None
    """Random change of the exponent [1]."""
    spread_jitter: float | None
    """Variance of a random spread of loads [mm²]."""
    idle_share: float | None
    """Share of the frames out of contact that an epoch takes [1]."""
    precision: str
    """"float32", or "bfloat16" for cards."""


def train(
    dataset: StrPath,
    out: StrPath,
    *,
    start: StrPath | None = None,
    simulated: StrPath | None = None,
    device: str = "auto",
    threads: int | None = None,
    compiled: bool = False,
    leave_out: int | None = None,
    tensorboard: bool = False,
    resume: bool = False,
    progress: Callable[[Progress], None] = lambda step: None,
    **options: Unpack[TrainingOptions],
) -> TrainedNetwork:
    """Train a network from readings to depth maps; returns its best epoch.

    Args:
        dataset: Dataset folder.
        out: Folder of the run; must not exist yet, unless ``resume``.
        start: A pretrained network to start from, or "shipped".
        simulated: A dataset of `simulate` whose frames are mixed in.
        device: "auto", "cpu", "cuda" or "cuda:N".
        threads: CPU threads; None takes one a core, at most 4, or one thread with ``start``.
        compiled: Let torch compile the network; for cards.
        leave_out: Groups of shapes that are left out in turn, for intervals that hold on unseen shapes.
        tensorboard: Write metrics for TensorBoard too.
        resume: Continue after the run's last epoch.
        progress: Called after each step.
        options: Settings of the run (`TrainingOptions`).

    Raises:
        UsageError: If ``out`` exists, there is no dataset, or a setting cannot train.
        FormatError: If the dataset is damaged or of another sensor than ``start``.
    """
    begun = pretrained(os.fspath(start)) if start else None
    settings = recipe(options, begun, simulated is not None)
    folder = Path(out)
    frames = read_frames(dataset)
    mixed = read_frames(simulated) if simulated else None
    log = event_log(folder) if tensorboard else lambda step: None

    def listen(step: Progress) -> None:
        progress(step)
        log(step)

    # From a pretrained network few presses are enough, and all of them are used: they are left out in turn.
    if begun:
        best = fit(
            frames, settings, folder, begun, device, resume, threads, listen, compiled, mixed, shape_groups=leave_out
        )
        return TrainedNetwork(best)
    best = train_on_frames(frames, settings, folder, device, resume, threads, listen, compiled, None, mixed)
    if leave_out is not None:
        calibrate_on_unseen_shapes(best, frames, leave_out, device, threads, lambda group: progress)
    return TrainedNetwork(best)
