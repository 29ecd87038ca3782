"""Networks that are trained in parallel on the same presses, and how one of them is trained in a given time."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import presses

from tacdata.training.frames.frames import Frames
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.metrics.depth_maps import CONTACT_THRESHOLD
from tacdata.training.pretraining.recipe import recipe
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import Split, divide
from tacdata.training.train import Progress, train

BROAD = {"gain_jitter": 0.1, "scale_jitter": 0.25, "exponent_jitter": 0.15}
"""How far a unit may be from the model, as the network that ships was trained until now [1]."""
NARROW = {"gain_jitter": 0.04, "scale_jitter": 0.12, "exponent_jitter": 0.06}
"""The part of it that a calibration with ten presses leaves. A network that must allow for more rounds its input:
two shapes whose readings differ by less than the gains' spread get the mean of their maps [1]."""
MIDDLE = {"gain_jitter": 0.05, "scale_jitter": 0.15, "exponent_jitter": 0.1, "spread_jitter": 0.3}
"""Between them, and with loads that spread less far or farther: the network that ships [1, mm^2]."""
SHARP = {"gain_jitter": 0.025, "scale_jitter": 0.1, "exponent_jitter": 0.06, "spread_jitter": 0.2}
VARIANTS = {"broad": BROAD, "narrow": NARROW, "middle": MIDDLE, "sharp": SHARP}
STEPS = 44_000
"""Steps of 2,048 frames from random weights on a card [count]. With 150,000 the validation loss was a tenth higher."""
FEWEST, MOST = 2, 80
"""Epochs, whatever the time allows [count]."""
_IDLE = 0.3
"""Share of the frames without contact that an epoch takes [1]."""
_LEARNED = 0.7
"""Share of the presses that are trained on, about [1]."""
_TRIED, _STEPS = 8, 300
"""Files of presses, and steps, that tell how long a step takes [count]."""
_VALIDATION = 4.0
"""Time of an epoch's validation [s]."""
_HELD, _VALIDATED = 8, 120
"""Presses of a card's run that are held out, and that tell the loss [count]."""
_AFTER = 10.0
"""Time for the work after the last step [s]."""
_AROUND = 100.0
"""Time before the first epoch and after the last: reading, calibration, intervals, readings seen [s]."""


def settings(name: str, epochs: int, batch: int, start: Checkpoint | None = None) -> TrainingSettings:
    """Return the recipe of a variant: large steps from random weights, smaller ones from a network, without a pull."""
    asked = {
        "batch_size": batch,
        "idle_share": _IDLE,
        "epochs": epochs,
        "network": "pattern",
        "learning_rate": 1e-3 if start else 1.5e-3,
        "pull": 0.0,
        **VARIANTS[name],
    }
    return recipe(asked if start else {**asked, "arguments": {"hidden": 512, "layers": 4}}, start)


def train_one(
    name: str,
    solved: Path,
    packed: Path,
    runs: Path,
    out: Path,
    until: float,
    device: str,
    batch: int,
    start: Checkpoint | None = None,
    shown: Callable[[str], None] = print,
) -> None:
    """Train a variant until a time; a trial measures how many epochs fit.

    Args:
        name: One of `VARIANTS`.
        solved: Folder of the solved presses.
        packed: Their frames.
        runs: Folder of the runs.
        out: Where NAME.safetensors is put.
        until: When it must be done [s since 1970].
        device: Device of the training.
        batch: Frames a step.
        start: The network that it goes on from; random weights if left out.
        shown: Called with each line of progress.
    """
    began = time.time()

    def told(progress: Progress) -> None:
        if progress.finished:
            line = progress.finished
            shown(
                f"{name}: epoch {line['epoch']} of {progress.epochs}, {line['seconds']:.1f} s, validation loss "
                f"{line['validation_loss']:.6f}, contact RMSE {line['validation_contact_rmse_mm']:.4f} mm"
            )

    run, kept = runs / name, runs / f"{name}.epochs"
    if start is None and device != "cpu":
        import graphed

        frames = presses.thinned(presses.read(solved, packed))
        split = _nearly_all(divide(frames, "episode", 0))
        best = graphed.train_graphed(
            frames,
            settings(name, 1, batch),
            split,
            run,
            STEPS,
            until - _AFTER,
            shown=lambda line: shown(f"{name}: {line}"),
        )
        graphed.halved(best, out / f"{name}.safetensors")
        return
    resumed = (run / "last.safetensors").is_file()
    if not resumed:
        runs.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(run, ignore_errors=True)
        some = presses.thinned(presses.read(solved, packed, _TRIED))
        step = _step_seconds(some, settings(name, MOST, batch, start), runs / f"{name}-trial", device)
        steps = _steps(some, batch) * len(list(packed.glob("*.npz"))) / min(len(list(packed.glob("*.npz"))), _TRIED)
        epochs = int((until - time.time() - _AROUND) / (steps * step + _VALIDATION))
        kept.write_text(str(min(max(epochs, FEWEST), MOST)))
        shown(f"{name}: {1000 * step:.2f} ms a step, {steps:.0f} steps an epoch, so {kept.read_text()} epochs")
    frames = presses.thinned(presses.read(solved, packed))
    shown(f"{name}: {int(frames.valid.sum())} of {len(frames.taxels)} frames, read after {time.time() - began:.0f} s")
    asked = settings(name, int(kept.read_text()), batch, start)
    best = train(frames, asked, run, device, resumed, threads=2, listener=told, pretrained=start)
    out.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(best.path, out / f"{name}.safetensors")
    shown(f"{name}: done, {time.time() - began:.0f} s in all, best epoch {best.document['best']}")


def _nearly_all(split: Split) -> Split:
    """Return a division that learns from all presses but some: simulated ones need no test."""
    train = {*split.train, *split.test[_HELD:], *split.validation[_VALIDATED:]}
    return replace(split, train=tuple(sorted(train)), test=split.test[:_HELD], validation=split.validation[:_VALIDATED])


class _Enough(Exception):
    """The trial has measured how long a step takes."""


def _step_seconds(frames: Frames, recipe: TrainingSettings, run: Path, device: str) -> float:
    """Return how long a step takes [s] under the load of this machine: the mean after the first quarter."""
    times: list[float] = []

    def count(progress: Progress) -> None:
        times.append(time.monotonic())
        if len(times) >= _STEPS:
            raise _Enough

    shutil.rmtree(run, ignore_errors=True)
    with contextlib.suppress(_Enough):
        train(frames, recipe, run, device, threads=2, listener=count)
    first = len(times) // 4
    return (times[-1] - times[first]) / (len(times) - 1 - first)


def _steps(frames: Frames, batch: int) -> float:
    """Return the steps of an epoch [1]."""
    touching = frames.depth[frames.valid].max(axis=(1, 2)) > CONTACT_THRESHOLD
    return _LEARNED * float(touching.sum() + _IDLE * (~touching).sum()) / batch
