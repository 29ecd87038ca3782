"""The training loop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tacdata import documents, provenance, schemas
from tacdata.errors import TacdataError, UsageError
from tacdata.training.completion import HeldOut, complete
from tacdata.training.frames.channel_calibration import calibrate
from tacdata.training.frames.frames import Frames
from tacdata.training.frames.label_tensor import label_tensor
from tacdata.training.frames.normalization import normalization
from tacdata.training.frames.variation import Variation
from tacdata.training.frames.windows import Windows
from tacdata.training.inference import checkpoint
from tacdata.training.inference.compute import choose_device, reproducible
from tacdata.training.inference.predictor import predict
from tacdata.training.loss import normalized
from tacdata.training.metrics import depth_maps
from tacdata.training.networks.network import Network, create
from tacdata.training.rehearsal import Rehearsal
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import Split, divide

METRICS = "metrics.jsonl"
_PULLED = 10
"""Training presses up to which the pull towards pretrained weights has its full weight [count]."""
_VALIDATED = 20_000
"""Validation frames that choose the best epoch, evenly taken where there are more [count]."""


@dataclass(frozen=True)
class Progress:
    """How far a run has come."""

    epoch: int
    """The present epoch, from 1."""
    epochs: int
    """Epochs asked for."""
    step: int
    """Steps done in this epoch."""
    steps: int
    """Steps an epoch."""
    finished: dict[str, Any] | None = None
    """The epoch's line of metrics.jsonl, once it is finished."""


@dataclass
class _Run:
    """State of the loop."""

    network: Network
    optimizer: torch.optim.Optimizer
    document: dict[str, Any]
    """The checkpoint's document as far as it is known; epoch, best and history grow."""
    epoch: int = 0
    """Epochs done."""
    forward: Callable[[torch.Tensor], torch.Tensor] = field(init=False)
    """The network, compiled or not."""

    rehearsal: Rehearsal | None = None
    """Simulated frames that are mixed in."""
    origin: tuple[torch.Tensor, ...] = ()
    """The pretrained weights that the loss pulls towards; empty if it does not."""
    pull: float = 0.0
    """Weight of that pull [1]."""

    def __post_init__(self) -> None:
        """Take the network as it is."""
        self.forward = self.network.respond

    def start(
        self, pretrained: checkpoint.Checkpoint | None, simulated: Frames | None, settings: TrainingSettings
    ) -> None:
        """Copy the state of a pretrained network.

        Raises:
            UsageError: If the run was started from another one, or with other simulated frames.
        """
        brought = {
            "pretrained": pretrained.content_hash if pretrained else None,
            "simulated": simulated.dataset_hash if simulated else None,
        }
        for name, content in brought.items():
            if (earlier := self.document.get(name)) != content and self.epoch:
                raise UsageError(
                    f"resuming a run whose {name} is {(earlier or 'none')[:12]} with {(content or 'none')[:12]}",
                    "what it was started with",
                    "give the same --from and --simulated, or start a new run",
                )
        self.document |= {name: value for name, value in brought.items() if value}
        place = self.network.get_buffer("mean").device
        if settings.pull and pretrained:
            weights = checkpoint.load(pretrained.path, place).network.parameters()
            self.origin = tuple(weight.detach() for weight in weights)
            # The loss is a mean over frames, the pull a prior: with more data it weighs less.
            self.pull = settings.pull * min(1.0, _PULLED / len(self.document["split"]["train"]))
        if simulated:
            self.rehearsal = Rehearsal(simulated, pretrained, self.network, place)

    def pull_back(self) -> None:
        """Add the gradient of pull |weights - pretrained weights|^2 to that of the loss.

        Added by hand, it costs a pass over the weights; in the loss it cost as much as the network itself.
        """
        if self.origin:
            with torch.no_grad():
                for weight, start in zip(self.network.parameters(), self.origin, strict=True):
                    if weight.grad is not None:
                        weight.grad.add_(weight - start, alpha=2.0 * self.pull)


def train(
    frames: Frames,
    settings: TrainingSettings,
    out: Path,
    device: str = "auto",
    resume: bool = False,
    threads: int | None = None,
    listener: Callable[[Progress], None] = lambda progress: None,
    compiled: bool = False,
    pretrained: checkpoint.Checkpoint | None = None,
    simulated: Frames | None = None,
    split: Split | None = None,
    part: bool = False,
) -> checkpoint.Checkpoint:
    """Train a network and write ``out``: best.safetensors, last.safetensors, metrics.jsonl.

    The same frames, settings, device and machine give the same weights bit for bit, in one go or resumed.

    Args:
        frames: The dataset.
        settings: The recipe.
        out: Folder of the run; must not exist, or be empty, unless ``resume``.
        device: "auto", "cpu", "cuda" or "cuda:N".
        resume: Go on from ``out``'s last epoch; settings must be the same except for the number of epochs.
        threads: CPU threads; by default one a core, at most `compute.THREADS`; others may change last bits.
        listener: Called after every step and every epoch.
        compiled: Let torch compile the network first; pays off on GPUs, and changes last bits.
        pretrained: Start from its weights; it is calibrated again to these frames (`training.pretraining.cross_fit`).
        simulated: Frames of a simulated dataset, of which each step takes as many (`training.rehearsal`).
        split: Division of the dataset; by default the settings' own.
        part: Keep the last epoch alone, without corrected maxima, intervals and training readings, for a cross-fit.

    Returns:
        The checkpoint of the epoch with the lowest validation loss; of a ``part`` the last one.

    Raises:
        UsageError: If ``out`` is taken, the split is empty, or a resumed run has other settings or data.
        TacdataError: If the loss is no longer finite.
    """
    place = choose_device(device)
    if not resume:
        check_free(out)
    with reproducible(threads):
        begun = split or divide(frames, settings.split, settings.seed)
        run = _resumed(frames, settings, out, place) if resume else _started(frames, settings, begun, place, pretrained)
        if compiled:
            run.forward = torch.compile(run.network.respond)
        run.start(pretrained, simulated, settings)
        split = Split.from_document(run.document["split"])
        windows = Windows(frames, run.network.offsets, place)
        depth = label_tensor(frames.depth, place)
        learned = torch.as_tensor(frames.indices(split.train))
        validated = frames.indices(split.validation)
        validated = validated[:: -(-len(validated) // _VALIDATED)]
        always = torch.from_numpy(_always(frames, learned.numpy(), settings))
        while run.epoch < settings.epochs:
            began = time.monotonic()
            run.epoch += 1
            train_loss = _epoch(run, windows, depth, learned, always, frames, settings, listener)
            line = {
                "epoch": run.epoch,
                "train_loss": train_loss,
                **_validate(run.network, windows, frames, validated, settings),
                "seconds": round(time.monotonic() - began, 3),
            }
            _keep(run, line, out, not part)
            listener(Progress(run.epoch, settings.epochs, 0, 0, line))
        if part:
            return checkpoint.load(out / checkpoint.LAST, place)
        best = checkpoint.load(out, place)
        parts = [HeldOut(best.network, split.train, split.validation)]
        complete(best, best.document, frames, split.train, parts, pretrained)
    return checkpoint.load(out)


def check_free(out: Path) -> None:
    """Refuse a folder that holds anything.

    Raises:
        UsageError: If it does.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UsageError(
            f"{out} already exists",
            "a folder that does not exist yet",
            "choose another --out, or go on with that run by --resume",
        )


def _started(
    frames: Frames,
    settings: TrainingSettings,
    split: Split,
    place: torch.device,
    pretrained: checkpoint.Checkpoint | None,
) -> _Run:
    torch.manual_seed(settings.seed)
    network = create(settings.network, frames.sensor, settings.arguments)
    readings, calibration = frames.taxels[frames.indices(split.train)], {}
    if settings.calibrate:
        fitted = calibrate(frames, split.train)
        network.set_calibration(fitted.gain, fitted.exponent, fitted.mixing)
        calibration, readings = {"calibration": fitted.document}, fitted.force(readings)
    if pretrained:
        pretrained.check_sensor(frames.sensor, frames.origin)
        pretrained.check_unseen(frames.dataset_hash, frames.origin)
        # The normalization comes with the weights: they learned on signals of that scale.
        network.load_state_dict(pretrained.network.state_dict())
        statistics = pretrained.document["normalization"]
        mean, sd = (np.asarray(statistics[name], dtype=np.float32) for name in ("mean", "sd"))
    else:
        mean, sd = normalization(readings)
    network.set_normalization(mean, sd)
    network.to(place)
    sensor_hash = frames.sensor.content_hash
    parents = {"dataset": frames.dataset_hash, "sensor": sensor_hash}
    document = {
        "version": schemas.version("checkpoint"),
        "network": {
            "name": network.name,
            "arguments": network.arguments,
            "parameters": sum(p.numel() for p in network.parameters()),
        },
        "sensor": {"hash": sensor_hash, "document": frames.sensor.document},
        "dataset": {
            "hash": frames.dataset_hash,
            "path": frames.origin,
            "episodes": len(frames.episodes),
            "frames": len(frames.taxels),
            "virtual": frames.virtual,
            **({"simulated": True} if frames.simulated else {}),
        },
        "normalization": {"mean": mean.tolist(), "sd": sd.tolist()},
        **calibration,
        "split": split.document,
        "settings": settings.document,
        "history": [],
        "provenance": provenance.stamp("training.train", parents, _circumstances(place)),
    }
    return _Run(network, _optimizer(network, settings), document)


def _resumed(frames: Frames, settings: TrainingSettings, out: Path, place: torch.device) -> _Run:
    last = checkpoint.load(out / checkpoint.LAST, place)
    last.check_sensor(frames.sensor, frames.origin)
    if last.document["dataset"]["hash"] != frames.dataset_hash:
        raise UsageError(
            f"{out} was trained on dataset {last.document['dataset']['hash'][:12]}, "
            f"{frames.origin} is {frames.dataset_hash[:12]}",
            "the same dataset",
            "resume with it, or start a new run",
        )
    earlier_settings = last.settings.document
    if settings.schedule != "constant" and settings.epochs != earlier_settings["epochs"]:
        raise UsageError(
            f"resuming {out} with {settings.epochs} epochs instead of {earlier_settings['epochs']}",
            f"the same number: the {settings.schedule} schedule is laid out over them",
            "resume with that number, or start a new run",
        )
    changed = [k for k, v in settings.document.items() if k != "epochs" and v != earlier_settings[k]]
    if changed:
        words = "; ".join(f"{k} {settings.document[k]} instead of {earlier_settings[k]}" for k in changed)
        raise UsageError(
            f"resuming {out} with {words}",
            "the settings that it was started with; epochs may grow",
            "drop these options, or start a new run",
        )
    optimizer = _optimizer(last.network, settings)
    checkpoint.restore(optimizer, last.optimizer)
    last.document["settings"] = settings.document
    return _Run(last.network, optimizer, last.document, last.document["epoch"])


def _optimizer(network: Network, settings: TrainingSettings) -> torch.optim.Optimizer:
    # Fused, a step is one pass over the weights on a processor, and few kernels on a card.
    return torch.optim.AdamW(
        network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay, fused=True
    )


def _circumstances(place: torch.device) -> dict[str, Any]:
    """Environment that affects the last bits."""
    name = torch.cuda.get_device_name(place) if place.type == "cuda" else "cpu"
    return {"torch": torch.__version__, "device": name, "threads": torch.get_num_threads()}


def _epoch(
    run: _Run,
    windows: Windows,
    depth: torch.Tensor,
    indices: torch.Tensor,
    always: torch.Tensor,
    frames: Frames,
    settings: TrainingSettings,
    listener: Callable[[Progress], None],
) -> float:
    """Run one pass over the training frames ``indices`` (m,) and return the mean loss over them.

    Frames with ``always`` (m,) false take part at random.
    """
    run.network.train()
    for group in run.optimizer.param_groups:
        group["lr"] = settings.rate_at(run.epoch)
    varied = Variation(run.network, frames.sensor, settings)
    # Seeded by epoch, so that a resumed run draws the same order without any stored generator.
    torch.manual_seed(1_000_003 * settings.seed + run.epoch)
    place = windows.taxels.device
    if settings.idle_share < 1.0:
        indices = indices[always | (torch.rand(len(indices)) < settings.idle_share)]
    order = indices[torch.randperm(len(indices))].to(place)
    batches = order.split(settings.batch_size)
    # Summed on the device: reading the loss of each step would wait for the GPU.
    total = torch.zeros((), device=place)
    for step, batch in enumerate(batches, start=1):
        label = normalized(depth[batch.to(depth.device)].to(place), frames.sensor.map.depth_max)
        signals, label = varied(run.network.calibrated(windows.batch(batch)), label)
        if run.rehearsal:
            more, rehearsed = run.rehearsal.batch(len(batch))
            signals, label = torch.cat([signals, more]), torch.cat([label, rehearsed])
        with torch.autocast(place.type, torch.bfloat16, enabled=settings.precision == "bfloat16"):
            prediction = run.forward(signals)
        # In float32: bfloat16 has three digits, and the mean is over a thousand pixels.
        loss = settings.loss(prediction.float(), label)
        run.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        run.pull_back()
        run.optimizer.step()
        total += loss.detach() * len(batch)
        listener(Progress(run.epoch, settings.epochs, step, len(batches)))
    mean = float(total) / len(order)
    if not np.isfinite(mean):
        raise TacdataError(
            f"the loss of epoch {run.epoch} is {mean}",
            "a finite loss",
            "lower the learning rate, or resume from the last epoch, which is kept",
        )
    return mean


def _always(frames: Frames, learned: np.ndarray, settings: TrainingSettings) -> np.ndarray:
    """Return which of the frames ``learned`` (m,) every epoch takes [bool], shape (m,): all, or those in contact."""
    if settings.idle_share == 1.0:
        return np.ones(len(learned), bool)
    touching = np.zeros(len(frames.depth), bool)
    for span in frames.episodes:
        rows = slice(span.start, span.stop)
        touching[rows] = frames.depth[rows].max(axis=(1, 2)) > depth_maps.CONTACT_THRESHOLD
    return touching[learned]


def _validate(
    network: Network, windows: Windows, frames: Frames, indices: np.ndarray, settings: TrainingSettings
) -> dict[str, float | None]:
    """Return loss and median contact-region RMSE [mm] over the frames ``indices``."""
    top = frames.sensor.map.depth_max
    prediction = predict(network, windows, indices, top)
    label = frames.depth[indices]
    loss = settings.loss(torch.from_numpy(prediction) / top, normalized(torch.from_numpy(label), top))
    rmse = depth_maps.summarize(depth_maps.score_frames(prediction, label).contact_rmse).median
    return {"validation_loss": float(loss), "validation_contact_rmse_mm": rmse}


def _keep(run: _Run, line: dict[str, Any], out: Path, keep_best: bool) -> None:
    """Write the epoch down: best first, then last, so that a run interrupted between them repeats the epoch."""
    document = run.document
    document["history"] = [*document["history"], line]
    document["epoch"] = run.epoch
    better = "best" not in document or line["validation_loss"] < document["best"]["validation_loss"]
    if better:
        document["best"] = {"epoch": run.epoch, "validation_loss": line["validation_loss"]}
        if keep_best:
            checkpoint.save(out / checkpoint.BEST, run.network, None, document)
    checkpoint.save(out / checkpoint.LAST, run.network, run.optimizer, document)
    documents.write_text(out / METRICS, "".join(json.dumps(entry) + "\n" for entry in document["history"]))
