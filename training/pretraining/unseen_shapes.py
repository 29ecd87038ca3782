"""Intervals that hold on shapes that a network never saw: each shape's errors come from a network without it.

By default the errors are those of validation episodes. These have the shapes of the training episodes, so
errors on a shape unlike all others are outside too often. Here shapes are dealt into groups. For each a network is
trained on the others by the same recipe, and predicts the left-out group (cross-conformal prediction; V. Vovk,
Annals of Mathematics and Artificial Intelligence 74 (2015) 9). The errors of all groups together make the intervals.
A fit from pretrained weights has such networks already (`training.pretraining.cross_fit`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tacdata.errors import UsageError
from tacdata.training.frames.frames import EpisodeSpan, Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.compute import reproducible
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics import conformal_intervals
from tacdata.training.metrics.conformal_intervals import ConformalIntervals
from tacdata.training.splits.split import VALIDATION_SHARE, Split, share
from tacdata.training.train import Progress, train

SOURCE = "presses of shapes left out of training"
"""Whose errors such intervals hold."""
_SEED = 47
"""Separates the random numbers of groups from those of training."""


def calibrate_on_unseen_shapes(
    trained: Checkpoint,
    frames: Frames,
    groups: int,
    device: str = "auto",
    threads: int | None = None,
    begun: Callable[[int], Callable[[Progress], None]] = lambda group: lambda progress: None,
) -> ConformalIntervals:
    """Replace the intervals of a trained network by ones valid for unseen shapes; write them to its folder.

    Args:
        trained: The network, in its run's folder. The other networks are trained there too.
        frames: Its training frames.
        groups: Into how many groups the shapes are dealt; as many networks are trained.
        device: As of `train`.
        threads: As of `train`.
        begun: Called with each group's number; returns the listener of that training's progress.

    Raises:
        UsageError: If the training episodes have fewer shapes than groups.
    """
    spans = frames.spans((*trained.split.train, *trained.split.validation))
    maps, labels = [], []
    for number, test_group in enumerate(dealt(spans, groups, frames.origin)):
        division = _without(test_group, spans, trained.split)
        run = trained.path.parent / f"without-{number}"
        resume = (run / checkpoint.LAST).is_file()
        network = train(frames, trained.settings, run, device, resume, threads, begun(number), split=division)
        windows, top = Windows(frames, network.network.offsets), frames.sensor.map.depth_max
        with reproducible(threads):
            for episode in division.test:
                indices = frames.indices((episode,))
                maps.append(predict(network.network, windows, indices, top))
                labels.append(np.clip(frames.depth[indices], 0.0, top))
    intervals = conformal_intervals.calibrate(maps, labels, frames.sensor.map.pixel_pitch, trained.content_hash, SOURCE)
    conformal_intervals.write(trained.path.parent, intervals)
    return intervals


def dealt(spans: tuple[EpisodeSpan, ...], groups: int, origin: str) -> list[tuple[EpisodeSpan, ...]]:
    """Return presses in groups that share no shape.

    Raises:
        UsageError: If there are fewer shapes than groups, or one group.
    """
    shapes = sorted({span.shape for span in spans})
    if not 2 <= groups <= len(shapes):
        raise UsageError(
            f"{groups} groups of the {len(shapes)} shapes to train on in {origin}",
            f"2 to {len(shapes)}",
            "ask for fewer, or record more shapes",
        )
    turn = np.random.default_rng(_SEED).permutation(len(shapes)) % groups
    return [tuple(span for span in spans if turn[shapes.index(span.shape)] == group) for group in range(groups)]


def _without(group: tuple[EpisodeSpan, ...], spans: tuple[EpisodeSpan, ...], split: Split) -> Split:
    """Return a division whose test episodes are those held out; some of the others choose the epoch."""
    numbers = {span.number for span in group}
    remaining = [span.number for span in spans if span.number not in numbers]
    order = np.random.default_rng([_SEED, split.seed]).permutation(remaining)
    validation = set(order[: share(len(remaining), VALIDATION_SHARE)].tolist())
    train_on = tuple(n for n in remaining if n not in validation)
    return Split(split.name, split.seed, train_on, tuple(sorted(validation)), tuple(sorted(numbers)))
