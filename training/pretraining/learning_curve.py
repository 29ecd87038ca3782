"""Learning curve: the error on presses held out, over the number of presses trained on.

Started from a pretrained network and from random weights, on the same presses. The presses held out are the same for
every number. Numbers are nested: the 10 presses of a seed are among its 30.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tacdata import documents, provenance, schemas
from tacdata.errors import FormatError, UsageError
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.checkpoint import LAST, Checkpoint
from tacdata.training.inference.compute import reproducible
from tacdata.training.inference.predictor import predict
from tacdata.training.metrics.depth_maps import score_frames
from tacdata.training.pretraining.cross_fit import fit
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import VALIDATION_SHARE, Split, divide, share
from tacdata.training.train import Progress, train

FILE = "curve.json"
PRESSES = (0, 3, 10, 30, 100, 300)
"""Numbers of presses of the default curve [1]."""
DEEP = 0.2
"""Frames whose label is deeper count for the second overlap [mm]: noise decides the region of shallower ones."""
SCRATCH_EPOCHS = 60
"""Passes over the frames from random weights; a pretrained start needs a third."""


@dataclass(frozen=True)
class CurvePoint:
    """The error of one network on the presses held out."""

    start: str
    """Where training started: "pretrained", or the network trained from random weights."""
    presses: int
    """Recorded presses that it was trained on, those that chose the epoch included."""
    seed: int
    """Seed of the presses and of the training."""
    centroid_error: float
    """Median distance of the centroids over the frames in contact [px]."""
    contact_rmse: float
    """Median root mean square error over the contact region [mm]."""
    iou: float
    """Median overlap of the contact regions over the frames in contact [1]."""
    iou_deep: float
    """Mean overlap over the frames deeper than `DEEP` [1]."""
    missed: float
    """Share of the frames in contact in which it sees none [1]."""


def learning_curve(
    frames: Frames,
    pretrained: Checkpoint | None,
    out: Path,
    presses: Sequence[int] = PRESSES,
    seeds: Sequence[int] = (0, 1, 2),
    split: str = "episode",
    networks: Sequence[str] = ("pattern",),
    simulated: Frames | None = None,
    device: str = "auto",
    threads: int | None = None,
    report: Callable[[CurvePoint], None] = lambda point: None,
    begun: Callable[[str, int, int], Callable[[Progress], None]] = lambda *_: lambda progress: None,
) -> dict[str, Any]:
    """Train and score every point of the curve; finished points in ``out`` are kept.

    Args:
        frames: The recorded dataset.
        pretrained: The network to start from; None for random weights alone.
        out: Folder of the runs and of `FILE`.
        presses: How many presses to train on; 0 is the pretrained network as it is. Too large numbers are left out.
        seeds: Seeds of the presses and of the training.
        split: Which presses are held out; a file name in training/splits.
        networks: Networks that start from random weights.
        simulated: Simulated frames to mix in.
        device: As of `train`.
        threads: As of `train`.
        report: Called with every point.
        begun: Called with start, presses and seed before each run; returns the listener of its progress.

    Returns:
        The document of the curve (`schemas/learning_curve.schema.json`).

    Raises:
        UsageError: If ``out`` holds another curve, no number of presses is possible, or simulated frames are to be
            mixed into no pretrained network's training.
        FormatError: If the dataset is of another sensor.
    """
    if pretrained:
        pretrained.check_sensor(frames.sensor, frames.origin)
    if frames.simulated:
        raise UsageError(
            f"{frames.origin} is simulated",
            "recorded presses: the curve says how many of them are needed",
            "give the dataset of a unit",
        )
    parents = {"dataset": frames.dataset_hash}
    if pretrained:
        pretrained.check_unseen(frames.dataset_hash, frames.origin)
        parents["pretrained"] = pretrained.content_hash
    elif simulated:
        raise UsageError(
            "simulated frames beside random weights",
            "simulated frames where a pretrained network is fitted",
            "leave --simulated out, or name a pretrained network by --from",
        )
    parents |= {"simulated": simulated.dataset_hash} if simulated else {}
    held_out = divide(frames, split, seeds[0])
    pool = tuple(sorted({*held_out.train, *held_out.validation}))
    # A single press cannot be trained on and choose the epoch as well.
    possible = [count for count in presses if count <= len(pool) and count != 1 and (count or pretrained)]
    if not possible:
        raise UsageError(
            f"{list(presses)} presses of {len(pool)} that are not held out",
            f"{'0, or ' if pretrained else ''}2 to {len(pool)} presses",
            "record more presses, or ask for fewer",
        )
    document = _document(out, split, held_out, parents)
    done = {(point["start"], point["presses"], point["seed"]) for point in document["points"]}
    for count in possible:
        for seed in seeds:
            for start in (*(("pretrained",) if pretrained else ()), *networks):
                if (start, count, seed) in done or (count == 0 and start != "pretrained"):
                    continue
                # Nested: the first n of one order, so that a larger number adds presses and replaces none.
                numbers = np.random.default_rng(seed).permutation(pool)[:count].tolist()
                network = pretrained.network if pretrained else None
                if count:
                    settings = _settings(start, seed, pretrained, simulated)
                    run, division = out / f"{start}-{count}-{seed}", _division(held_out, numbers, seed)
                    listener, resume = begun(start, count, seed), run.is_dir()
                    if start == "pretrained" and pretrained:
                        network = fit(
                            frames,
                            settings,
                            run,
                            pretrained,
                            device,
                            resume,
                            threads,
                            listener,
                            simulated=simulated,
                            split=division,
                        ).network
                    else:
                        resume = (run / LAST).is_file()
                        network = train(
                            frames, settings, run, device, resume, threads, listener, split=division
                        ).network
                with reproducible(threads):
                    point = _scored(network, frames, held_out.test, start, count, seed)
                document["points"].append(asdict(point))
                # Written after each point, so that an interrupted curve goes on from there.
                documents.write(out / FILE, document, "learning_curve")
                report(point)
    return document


def _settings(start: str, seed: int, pretrained: Checkpoint | None, simulated: Frames | None) -> TrainingSettings:
    if start == "pretrained":
        return recipe({"seed": seed}, pretrained, simulated is not None)
    return recipe({"seed": seed, "network": start, "epochs": SCRATCH_EPOCHS, "batch_size": 64})


def _division(held_out: Split, numbers: list[int], seed: int) -> Split:
    """Return the presses that a run trains on, those that choose its epoch, and those held out."""
    count = share(len(numbers), VALIDATION_SHARE)
    return replace(
        held_out,
        seed=seed,
        train=tuple(sorted(numbers[count:])),
        validation=tuple(sorted(numbers[:count])),
        test=held_out.test,
    )


def _scored(network: Any, frames: Frames, test: tuple[int, ...], start: str, presses: int, seed: int) -> CurvePoint:
    network = network.to("cpu")
    windows, indices = Windows(frames, network.offsets), frames.indices(test)
    label = np.clip(frames.depth[indices], 0.0, frames.sensor.map.depth_max)
    scores = score_frames(predict(network, windows, indices, frames.sensor.map.depth_max), label)
    touching, deep = scores.labelled, label.max(axis=(1, 2)) > DEEP
    if not deep.any():
        raise FormatError(
            f"{frames.origin}: no frame of the presses held out is deeper than {DEEP} mm",
            "presses into the skin",
            "record deeper presses, or hold out others by --split",
        )
    detected = touching & scores.predicted
    return CurvePoint(
        start,
        presses,
        seed,
        # A network that detects no contact gets the diagonal of the map, which is worse than any place.
        centroid_error=float(
            np.median(scores.centroid_error[detected]) if detected.any() else np.hypot(*network.map_shape)
        ),
        contact_rmse=float(np.median(scores.contact_rmse[touching])),
        iou=float(np.median(scores.iou[touching])),
        iou_deep=float(scores.iou[deep].mean()),
        missed=float(1 - detected.sum() / touching.sum()),
    )


def _document(out: Path, split: str, held_out: Split, parents: dict[str, str]) -> dict[str, Any]:
    fresh = {
        "version": schemas.version("learning_curve"),
        "split": split,
        "held_out": list(held_out.test),
        "points": [],
        "provenance": provenance.stamp("training.pretraining.learning_curve", parents, {"deep": DEEP}),
    }
    if not (out / FILE).is_file():
        return fresh
    stored = documents.read(out / FILE, "learning_curve")
    if stored["provenance"]["parents"] != fresh["provenance"]["parents"] or stored["split"] != split:
        raise UsageError(
            f"{out} holds the learning curve of another dataset, network or split",
            "the same ones, to go on with it",
            "choose another --out",
        )
    return stored
