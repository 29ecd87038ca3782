"""Predicts depth maps of one unlabelled sequence of readings, frame by frame or whole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from tacdata.errors import FormatError
from tacdata.training.inference.checkpoint import Checkpoint
from tacdata.training.inference.predictor import BATCH


@torch.inference_mode()
def sequence_maps(trained: Checkpoint, taxels: np.ndarray) -> np.ndarray:
    """Return depth maps [mm], shape (m, pixels_x, pixels_y), float32, clipped to 0 ... D_max.

    Frames beyond the ends are replaced by the first and the last, as in training (paper, eq. temporal_window).

    Args:
        trained: The network.
        taxels: Tared readings of successive frames [counts], shape (m, taxels).

    Raises:
        FormatError: If the readings are of another number of taxels, or hold values that are no numbers.
    """
    count = trained.sensor.taxels.count
    finite = bool(np.isfinite(taxels).all())
    if taxels.ndim != 2 or taxels.shape[1] != count or not finite:
        raise FormatError(
            f"readings of shape {taxels.shape}" + ("" if finite else " with values that are no numbers"),
            f"finite, {count} taxels a frame",
            "give the board's frames, tared",
        )
    network, depth_max = trained.network.eval(), trained.sensor.map.depth_max
    signals = torch.as_tensor(np.ascontiguousarray(taxels, np.float32))
    offsets, last = torch.tensor(network.offsets), len(taxels) - 1
    result = np.empty((len(taxels), *network.map_shape), np.float32)
    device = network.get_buffer("mean").device
    for start in range(0, len(taxels), BATCH):
        frames = torch.arange(start, min(start + BATCH, len(taxels)))
        windows = signals[(frames[:, None] + offsets).clamp(0, last)].to(device)
        result[start : start + len(frames)] = (network(windows).clamp(0.0, 1.0) * depth_max).cpu().numpy()
    return result


def identity(trained: Checkpoint) -> dict[str, str | int]:
    """Return which network this is: hash of its file, name, epoch, look-ahead [frames], sensor."""
    return {
        "hash": trained.content_hash,
        "network": trained.network.name,
        "epoch": trained.document["epoch"],
        "lookahead": max(trained.network.offsets),
        "sensor": trained.sensor.content_hash,
    }


def window_map(trained: Checkpoint) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from one window of tared readings [counts], shape (T, taxels), to its map [mm], float32.

    From then on this process computes on one thread: a single window is so little work that more would only wait for
    each other.
    """
    torch.set_num_threads(1)
    network, depth_max = trained.network.eval(), trained.sensor.map.depth_max
    device = network.get_buffer("mean").device

    @torch.inference_mode()
    def estimate(window: np.ndarray) -> np.ndarray:
        signals = torch.as_tensor(np.ascontiguousarray(window, np.float32))[None].to(device)
        return (network(signals).clamp(0.0, 1.0) * depth_max)[0].cpu().numpy()

    return estimate
