"""A trained network as an ONNX file, checked against torch before it is kept."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from tacdata.errors import FormatError, UsageError
from tacdata.training.inference.checkpoint import Checkpoint

OPSET = 17
TOLERANCE = 1e-4
"""Largest difference from torch that is allowed [mm]."""
KEY = "tacdata"


class DepthNetwork(nn.Module):
    """Windows of tared readings [counts] to depth maps [mm]: normalization, network and clipping in one."""

    def __init__(self, trained: Checkpoint) -> None:
        """Wrap a checkpoint's network."""
        super().__init__()
        self.network, self.depth_max = trained.network, trained.sensor.map.depth_max

    def forward(self, windows: torch.Tensor) -> torch.Tensor:
        """Return maps [mm], shapes (b, T, taxels) -> (b, pixels_x, pixels_y)."""
        return self.network(windows).clamp(0.0, 1.0) * self.depth_max


@dataclass(frozen=True)
class Exported:
    """The written file."""

    path: Path
    difference: float
    """Largest difference from torch over the windows tried [mm]."""
    windows: int
    """How many windows were tried, in batches of one and of all."""


def export(trained: Checkpoint, path: Path, windows: np.ndarray | None = None) -> Exported:
    """Write a network as ONNX (opset 17, one input "windows", one output "depth") and compare both.

    The file's metadata has sensor, frames of the window, units and checkpoint under the key "tacdata".

    Args:
        trained: The network.
        path: File to write; must not exist.
        windows: Readings to compare on [counts], shape (m, T, taxels); random ones of the size that the network was
            trained on if None.

    Raises:
        UsageError: If the file exists, or onnx or onnxruntime are not installed.
        FormatError: If the exported network answers differently; nothing is kept then.
    """
    if path.exists():
        raise UsageError(f"{path} exists", "a new file; nothing is overwritten", "choose another name")
    onnx, runtime = _packages()
    network = trained.network.to("cpu").eval()
    inputs = random_windows(trained) if windows is None else np.ascontiguousarray(windows, np.float32)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        _write(onnx, trained, DepthNetwork(trained).eval(), torch.from_numpy(inputs[:2]), temporary)
        session = runtime.InferenceSession(temporary, providers=["CPUExecutionProvider"])
        with torch.inference_mode():
            reference = DepthNetwork(trained).eval()(torch.from_numpy(inputs)).numpy()
        batch_output = session.run(None, {"windows": inputs})[0]
        # Singly, too: a batch size that the tracer took for a constant shows only at another one.
        single = np.concatenate([session.run(None, {"windows": window[None]})[0] for window in inputs[:16]])
        difference = float(max(np.abs(batch_output - reference).max(), np.abs(single - reference[:16]).max()))
        if not difference <= TOLERANCE:
            raise FormatError(
                f"the exported {network.name} differs from torch by {difference:.2g} mm",
                f"at most {TOLERANCE:g} mm",
                "report this; nothing was kept",
            )
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    finally:
        Path(temporary).unlink(missing_ok=True)
    return Exported(path, difference, len(inputs))


def random_windows(trained: Checkpoint, count: int = 64, seed: int = 0) -> np.ndarray:
    """Return windows of random readings as large as those trained on [counts], shape (count, T, taxels), float32."""
    values = trained.document["normalization"]
    mean, sd = np.array(values["mean"]), np.array(values["sd"])
    noise = np.random.default_rng(seed).normal(size=(count, len(trained.network.offsets), len(mean)))
    return (mean + 2.0 * sd * noise).astype(np.float32)


def _packages() -> tuple[Any, Any]:
    import onnx
    import onnxruntime

    return onnx, onnxruntime


def _write(onnx: Any, trained: Checkpoint, estimator: DepthNetwork, example: torch.Tensor, path: str) -> None:
    with warnings.catch_warnings():
        # torch recommends its newer exporter, which needs a package more and takes ten times as long.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            estimator,
            (example,),
            path,
            input_names=["windows"],
            output_names=["depth"],
            opset_version=OPSET,
            dynamic_axes={"windows": {0: "frames"}, "depth": {0: "frames"}},
            dynamo=False,
        )
    model = onnx.load(path)
    onnx.checker.check_model(model)
    metadata = {
        "checkpoint": trained.content_hash,
        "network": trained.network.name,
        "offsets": list(trained.network.offsets),
        "sensor": {"name": trained.sensor.name, "hash": trained.sensor.content_hash},
        "rate_hz": trained.sensor.taxels.rate,
        "windows": "tared readings [counts], (frames, window, taxels)",
        "depth": "[mm], (frames, pixels_x, pixels_y)",
    }
    entry = model.metadata_props.add()
    entry.key, entry.value = KEY, json.dumps(metadata)
    onnx.save(model, path)
