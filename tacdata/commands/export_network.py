"""Write a trained network as an ONNX file."""

from pathlib import Path
from typing import Annotated

import typer

from tacdata.commands.command import LEARN, Result

ORDER = 70
PANEL = LEARN
EXAMPLES = (
    "tacdata export-network network --out network.onnx",
    "tacdata export-network network --dataset dataset --out network.onnx",
    "tacdata export-network network/best.pt --out network.onnx --json",
)


def run(
    network: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a training run, or a checkpoint file.")],
    out: Annotated[Path, typer.Option(help="ONNX file to write; must not exist.")],
    dataset: Annotated[
        Path | None, typer.Option(help="Compare on this dataset's readings instead of random ones.")
    ] = None,
) -> Result:
    """Write a network as ONNX, with normalization and clipping inside; kept only if it answers like torch."""
    import numpy as np
    import torch

    from tacdata.training.frames.data import read_frames
    from tacdata.training.frames.windows import Windows
    from tacdata.training.inference import checkpoint
    from tacdata.training.inference.onnx_export import export

    trained = checkpoint.load(network)
    readings = None
    if dataset:
        frames = read_frames(dataset)
        trained.check_sensor(frames.sensor, frames.origin)
        windows = Windows(frames, trained.network.offsets)
        # Evenly over the dataset: neighbouring windows are nearly equal and would show less.
        indices = np.linspace(0, len(windows) - 1, min(len(windows), 256)).astype(np.int64)
        readings = windows.batch(torch.from_numpy(indices)).numpy()
    exported = export(trained, out, readings)
    print(f"{exported.path}: differs from torch by at most {exported.difference:.1e} mm on {exported.windows} windows")
    print(f"input windows (frames, {len(trained.network.offsets)}, {trained.sensor.taxels.count}) of tared counts")
    return Result(exported)
