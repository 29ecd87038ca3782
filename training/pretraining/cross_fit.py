"""Fit of a pretrained network to recorded presses, with few of them by cross-fitting: none is kept from learning.

Four networks start from the same weights. Each learns from three quarters of the presses, and is judged on the rest.

    weights = pretrained + share x (mean of the four - pretrained)

The share is the smallest one whose error on the presses left out is at most a standard error above the least. It is 0
where learning surely helps no unseen press. The channels' calibration alone makes the fit then. So by that measure a
fit is never worse than the calibrated network.

Weights that were fitted from one start may be averaged (M. Wortsman et al., ICML 2022). The errors of presses left out
also give intervals and the scale of novelty.

With many presses one network is enough. It learns from the training presses, and those of validation choose its epoch.
"""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tacdata import documents, provenance
from tacdata.errors import UsageError
from tacdata.training.completion import HeldOut, chosen, complete
from tacdata.training.frames.channel_calibration import calibrate
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.compute import reproducible
from tacdata.training.loss import normalized
from tacdata.training.networks.network import Network
from tacdata.training.pretraining.unseen_shapes import SOURCE as UNSEEN
from tacdata.training.pretraining.unseen_shapes import dealt
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import Split, divide
from tacdata.training.train import METRICS, Progress, check_free, train

FOLDS = 4
"""Networks, each fitted without a part of the presses [count]."""
MANY = 24
"""Presses beyond which one network is fitted [count]: four cost more, and gained little on rig 20 with 30."""
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25)
"""Shares of the way from the pretrained weights that are tried [1]: above 1 as the pull holds each network back."""
THREADS = 1
"""CPU threads where none are asked for: with two on a busy computer a step took four times the processor's time."""
JUDGED = 40
"""Frames of a press left out that judge a share, evenly taken [count]."""


def fit(
    frames: Frames,
    settings: TrainingSettings,
    out: Path,
    pretrained: Checkpoint,
    device: str = "auto",
    resume: bool = False,
    threads: int | None = None,
    listener: Callable[[Progress], None] = lambda progress: None,
    compiled: bool = False,
    simulated: Frames | None = None,
    split: Split | None = None,
    shape_groups: int | None = None,
) -> Checkpoint:
    """Fit a network to presses and write ``out``: its checkpoint, intervals, training readings and metrics.

    Presses of training and validation are both learned from. A fit that was interrupted goes on; one that has ended is
    returned as it is.

    Args:
        frames: The dataset.
        settings: The recipe.
        out: Folder of the run; must not exist, or be empty, unless ``resume``.
        pretrained: The network to start from.
        device: As of `train`.
        resume: Go on with the run in ``out``.
        threads: CPU threads; `THREADS` by default. Others may change last bits.
        listener: As of `train`; epochs are counted over all networks.
        compiled: As of `train`.
        simulated: As of `train`.
        split: Division of the dataset; by default the settings' own.
        shape_groups: Leave whole shapes out, dealt into so many groups, so that intervals hold for unseen shapes;
            presses at random by default.

    Raises:
        UsageError: If ``out`` is taken, there are fewer than two presses, or a resumed run has other settings or data.
        TacdataError: If the loss is no longer finite.
    """
    division = split or divide(frames, settings.split, settings.seed)
    presses = tuple(sorted({*division.train, *division.validation}))
    if len(presses) < 2:
        raise UsageError(f"a fit to {len(presses)} press", "two presses or more", "record more")
    threads = threads or THREADS
    # Enough presses for validation ones of their own.
    if len(presses) > MANY and shape_groups is None:
        resume = resume and (out / checkpoint.LAST).is_file()
        return train(
            frames, settings, out, device, resume, threads, listener, compiled, pretrained, simulated, division
        )
    if not resume:
        check_free(out)
    elif (out / checkpoint.BEST).is_file():
        return _ended(out, settings, frames, pretrained)
    source = "presses left out of training"
    if shape_groups is not None:
        groups = dealt(frames.spans(presses), shape_groups, frames.origin)
        parts, source = [tuple(span.number for span in group) for group in groups], UNSEEN
    else:
        parts = _dealt(presses, settings.seed)
    members = []
    for number, part in enumerate(parts):
        run = out / f"part-{number}"
        remaining = tuple(press for press in presses if press not in part)
        started = (run / checkpoint.LAST).is_file()
        counter = _counted(listener, number, len(parts))
        left_out = replace(division, train=remaining, validation=part)
        members.append(
            train(
                frames,
                settings,
                run,
                device,
                started,
                threads,
                counter,
                compiled,
                pretrained,
                simulated,
                left_out,
                True,
            )
        )
    with reproducible(threads):
        losses = _losses(members, pretrained, frames, settings)
        # How far the weights move is decided by presses that no member learned from; not at all is one of the choices.
        share = SHARES[chosen(losses)]
        division = replace(division, train=presses, validation=())
        document = _document(members, division, losses, share)
        ends = [member.network for member in members]
        # Members that began at one point can be averaged by their weights: one network a frame in place of several.
        network = between(pretrained.network, ends, share, copy.deepcopy(ends[0]))
        if settings.calibrate:
            fitted = calibrate(frames, division.train)
            network.set_calibration(fitted.gain, fitted.exponent, fitted.mixing)
            document["calibration"] = fitted.document
        # Intervals come from members and the presses that they never saw.
        held_out = [
            HeldOut(
                between(pretrained.network, [end], share, end),
                member.split.train,
                member.split.validation,
                shape_groups is not None,
            )
            for end, member in zip(ends, members, strict=True)
        ]
        best = Checkpoint(out / checkpoint.BEST, document, network, members[0].sensor, {})
        documents.write_text(out / METRICS, "".join(json.dumps(line) + "\n" for line in document["history"]))
        complete(best, document, frames, division.train, held_out, pretrained, source)
    for number in range(len(parts)):
        shutil.rmtree(out / f"part-{number}")
    return checkpoint.load(out)


def between(start: Network, ends: Sequence[Network], share: float, into: Network) -> Network:
    """Set the weights of a network to ``start`` + ``share`` (mean of ``ends`` - ``start``), and return it."""
    first, last = start.state_dict(), [end.state_dict() for end in ends]
    place = into.get_buffer("mean").device
    weights = {
        name: value.to(place) + share * (torch.stack([state[name] for state in last]).mean(dim=0) - value.to(place))
        for name, value in first.items()
    }
    into.load_state_dict(weights)
    return into.eval()


def _dealt(presses: tuple[int, ...], seed: int) -> list[tuple[int, ...]]:
    order = np.random.default_rng(seed).permutation(presses).tolist()
    return [tuple(sorted(order[k::FOLDS])) for k in range(min(FOLDS, len(order)))]


def _counted(listener: Callable[[Progress], None], number: int, count: int) -> Callable[[Progress], None]:
    """Return a listener that counts the epochs of all networks one after the other."""

    def counted(progress: Progress) -> None:
        epoch = progress.epoch + number * progress.epochs
        line = progress.finished and {**progress.finished, "epoch": epoch}
        listener(replace(progress, epoch=epoch, epochs=count * progress.epochs, finished=line))

    return counted


@torch.inference_mode()
def _losses(
    members: Sequence[Checkpoint], pretrained: Checkpoint, frames: Frames, settings: TrainingSettings
) -> np.ndarray:
    """Return the loss on each press left out by each of `SHARES`, shape (presses, shares)."""
    rows, top = [], frames.sensor.map.depth_max
    for member in members:
        windows = Windows(frames, member.network.offsets, member.network.get_buffer("mean").device)
        network = copy.deepcopy(member.network)
        for press in member.split.validation:
            indices = frames.indices((press,))
            indices = torch.as_tensor(indices[:: -(-len(indices) // JUDGED)])
            label = normalized(torch.as_tensor(frames.depth[indices.numpy()]).float(), top)
            batch, row = windows.batch(indices.to(windows.taxels.device)), []
            for share in SHARES:
                between(pretrained.network, [member.network], share, network)
                row.append(float(settings.loss(network.respond(network.calibrated(batch)).cpu(), label)))
            rows.append(row)
    return np.array(rows)


def _document(members: Sequence[Checkpoint], division: Split, losses: np.ndarray, share: float) -> dict[str, Any]:
    first, loss = members[0].document, float(losses.mean(axis=0).min())
    history = [
        {name: _mean([line[name] for line in lines]) if name != "epoch" else lines[0][name] for name in lines[0]}
        for lines in zip(*(member.document["history"] for member in members), strict=True)
    ]
    return {
        **first,
        "split": division.document,
        "history": history,
        "best": {"epoch": first["epoch"], "validation_loss": loss},
        "cross_fit": {
            "left_out": [list(member.split.validation) for member in members],
            "shares": list(SHARES),
            "losses": losses.mean(axis=0).tolist(),
            "share": share,
        },
        "provenance": provenance.stamp(
            "training.pretraining.cross_fit", first["provenance"]["parents"], first["provenance"]["parameters"]
        ),
    }


def _mean(values: list[float | None]) -> float | None:
    numbers = [value for value in values if value is not None]
    return float(np.mean(numbers)) if numbers else None


def _ended(out: Path, settings: TrainingSettings, frames: Frames, pretrained: Checkpoint) -> Checkpoint:
    """Return a fit that has ended.

    Raises:
        UsageError: If it is another one.
    """
    trained = checkpoint.load(out)
    recorded = trained.document["settings"], trained.document["dataset"]["hash"], trained.document.get("pretrained")
    if recorded != (settings.document, frames.dataset_hash, pretrained.content_hash):
        raise UsageError(
            f"resuming {out}, a fit that has ended, with other settings, presses or another start",
            "the same ones",
            "fit into a new folder",
        )
    return trained
