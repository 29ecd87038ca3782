"""A trained network on disk: a safetensors file with metadata.

The metadata is the document of `schemas/checkpoint.schema.json`. It shares one file with the weights so that
neither can be lost or swapped alone, and nothing in that file can run code.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import torch
from safetensors.torch import save_file

from tacdata import documents, provenance
from tacdata.errors import FormatError, UsageError
from tacdata.paths import StrPath
from tacdata.sensor import Sensor
from tacdata.training.frames.channel_calibration import ChannelCalibration
from tacdata.training.frames.peak_process import PeakProcess
from tacdata.training.networks.network import Network, create
from tacdata.training.settings import TrainingSettings
from tacdata.training.splits.split import Split

KEY = "checkpoint"
BEST, LAST = "best.safetensors", "last.safetensors"


@dataclass(frozen=True)
class Checkpoint:
    """A network with its document."""

    path: Path
    document: dict[str, Any]
    """`schemas/checkpoint.schema.json`."""
    network: Network
    sensor: Sensor
    """The sensor that it was trained for."""
    optimizer: dict[str, torch.Tensor]
    """State of the optimizer, by "parameter.quantity"; empty if not kept."""

    @property
    def split(self) -> Split:
        """The division of the dataset that it was trained with."""
        return Split.from_document(self.document["split"])

    @property
    def settings(self) -> TrainingSettings:
        """The recipe that it was trained with."""
        return TrainingSettings.from_document(self.document["settings"])

    @property
    def calibration(self) -> ChannelCalibration | None:
        """How it turns readings into forces; None if it takes readings as they are."""
        document = self.document.get("calibration")
        return ChannelCalibration.from_document(document, self.sensor.taxels) if document else None

    @property
    def content_hash(self) -> str:
        """Hash of the file: the checkpoint's identity."""
        return provenance.file_hash(self.path)

    def check_sensor(self, sensor: Sensor, origin: str) -> None:
        """Refuse data of another sensor.

        Raises:
            FormatError: If any value of the two descriptions that can change a result differs.
        """
        if sensor.content_hash == self.sensor.content_hash:
            return
        raise FormatError(
            f"{self.path} was trained for sensor {self.sensor.name} ({_differences(self.sensor, sensor)}); "
            f"{origin} is of sensor {sensor.name}",
            f"data of the sensor with hash {self.sensor.content_hash[:12]}",
            "train a network for this sensor, or give the dataset of the other one",
        )

    def check_unseen(self, dataset: str, origin: str) -> None:
        """Refuse to start from a network that learned from the dataset: the presses held out would not be new to it.

        Raises:
            UsageError: If it was trained on the dataset with this hash.
        """
        if self.document["dataset"]["hash"] == dataset:
            raise UsageError(
                f"{self.path} was trained on {origin} itself",
                "a network that has not seen these presses: others hold them out than it did",
                "start from `shipped` or from one trained on simulated presses, or go on with that run by --resume",
            )


def save(path: Path, network: Network, optimizer: torch.optim.Optimizer | None, document: dict[str, Any]) -> None:
    """Write a checkpoint; a crash leaves the old file or the new one."""
    documents.check(document, "checkpoint", str(path))
    # safetensors takes contiguous tensors only.
    tensors = {f"network.{k}": v.detach().cpu().contiguous() for k, v in network.state_dict().items()}
    if isinstance(network.peak, PeakProcess):
        tensors |= network.peak.tensors
    if optimizer is not None:
        for index, values in optimizer.state_dict()["state"].items():
            # The optimizer's moments, too: without them a resumed run takes other steps.
            tensors |= {f"optimizer.{index}.{k}": v.detach().cpu().contiguous() for k, v in values.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    save_file(tensors, temporary, {KEY: json.dumps(document)})
    with open(temporary, "rb") as stream:
        # On the disk before the name changes: else a crash could leave the name with an empty file.
        os.fsync(stream.fileno())
    # `mkstemp` makes a file that only its owner may read.
    os.chmod(temporary, 0o644)
    os.replace(temporary, path)


def load(path: StrPath, device: torch.device | str = "cpu") -> Checkpoint:
    """Read a checkpoint: a file, or a run's folder, of which the best epoch is taken.

    Raises:
        UsageError: If there is none.
        FormatError: If the file is damaged, of another version, or its weights do not fit its document.
    """
    path = Path(path)
    path = path / BEST if path.is_dir() else path
    if not path.is_file():
        raise UsageError(
            f"no checkpoint {path}",
            "a folder that `tacdata train` wrote, one of its .safetensors files, or `shipped`",
            "check the path, train first, or take `shipped`, which is fitted to no unit",
        )
    document, tensors = _read(path)
    documents.check(document, "checkpoint", str(path))
    sensor = Sensor.from_document(document["sensor"]["document"], f"{path}: sensor")
    network = create(document["network"]["name"], sensor, document["network"]["arguments"])
    weights = {k.removeprefix("network."): v for k, v in tensors.items() if k.startswith("network.")}
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise FormatError(
            f"{path}: the weights do not fit network {network.name}: {error}",
            "weights written by this release of the network",
            "train again",
        ) from None
    mean, sd = (np.asarray(document["normalization"][k], dtype=np.float32) for k in ("mean", "sd"))
    if mean.shape != (sensor.taxels.count,) or sd.shape != mean.shape:
        raise FormatError(
            f"{path}: normalization of {mean.size} and {sd.size} channels", f"{sensor.taxels.count} each", "train again"
        )
    network.set_normalization(mean, sd)
    if calibration := document.get("calibration"):
        channel_calibration = ChannelCalibration.from_document(calibration, sensor.taxels)
        network.set_calibration(channel_calibration.gain, channel_calibration.exponent, channel_calibration.mixing)
    optimizer = {k.removeprefix("optimizer."): v for k, v in tensors.items() if k.startswith("optimizer.")}
    loaded = Checkpoint(path, document, network.to(device).eval(), sensor, optimizer)
    if peak := document.get("peak"):

        def before(weights: dict[str, torch.Tensor]) -> Network:
            origin = create(network.name, sensor, network.arguments)
            origin.load_state_dict(weights)
            origin.set_normalization(mean, sd)
            return origin.requires_grad_(False).to(device).eval()

        network.peak = _correction(peak, tensors, before, sensor.taxels.centers, device)
    return loaded


def restore(optimizer: torch.optim.Optimizer, state: dict[str, torch.Tensor]) -> None:
    """Put a saved state back into an optimizer of the same network."""
    # safetensors has flat names, an optimizer's state is nested.
    nested: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in state.items():
        index, quantity = name.split(".", 1)
        nested.setdefault(int(index), {})[quantity] = value
    optimizer.load_state_dict({"state": nested, "param_groups": optimizer.state_dict()["param_groups"]})


def _correction(
    document: dict[str, Any],
    tensors: dict[str, torch.Tensor],
    before: Callable[[dict[str, torch.Tensor]], Network],
    centers: np.ndarray,
    device: torch.device | str,
) -> PeakProcess:
    """Return the correction of a file's maxima, with those of the networks before it."""
    weights, earlier = (
        {name.removeprefix(part): value for name, value in tensors.items() if name.startswith(part)}
        for part in ("origin.", "prior.")
    )
    origin = before(weights) if weights else None
    if origin is not None and "prior" in document:
        origin.peak = _correction(document["prior"], earlier, before, centers, device)
    return PeakProcess.from_document(document, tensors, centers, origin, device)


def _read(path: Path) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    try:
        with safetensors.safe_open(str(path), framework="pt") as stream:
            document = json.loads((stream.metadata() or {})[KEY])
            return document, {name: stream.get_tensor(name) for name in stream.keys()}
    except (safetensors.SafetensorError, KeyError, ValueError, OSError) as error:
        raise FormatError(
            f"{path} is not a readable checkpoint: {error}",
            "a file that `tacdata train` wrote",
            "take last.safetensors or another run, or train again",
        ) from None


def _differences(trained: Sensor, sensor: Sensor) -> str:
    ours, theirs = trained.document, sensor.document
    differences = [
        f"{part}/{key} {value} against {theirs[part].get(key)}"
        for part in ("taxels", "skin", "material", "contact", "map")
        for key, value in ours[part].items()
        if theirs[part].get(key) != value
    ]
    return "; ".join(differences[:3])
