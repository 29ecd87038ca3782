"""The metrics of a run as an event file for TensorBoard, in addition to metrics.jsonl."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tacdata.extras import missing_package
from tacdata.training.train import Progress

FOLDER = "tensorboard"


def event_log(run: Path) -> Callable[[Progress], None]:
    """Return a listener that writes every finished epoch's metrics to RUN/tensorboard.

    The file is made with the first epoch, so that a run which is refused leaves nothing.

    Raises:
        PackageError: If tensorboard is not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ModuleNotFoundError as error:
        instead = "leave the option out: metrics.jsonl holds the same figures"
        raise missing_package(error, "--tensorboard", instead) or error from None
    writers: list[Any] = []

    def write(progress: Progress) -> None:
        line = progress.finished
        if line is None:
            return
        if not writers:
            writers.append(SummaryWriter(str(run / FOLDER)))
        for name, value in line.items():
            if name != "epoch" and value is not None:
                writers[0].add_scalar(name, value, line["epoch"])
        writers[0].flush()

    return write
