"""Predicts the depth maps of frames with a network, in millimetres."""

from __future__ import annotations

import time

import numpy as np
import torch

from tacdata.training.frames.peak_process import PeakProcess
from tacdata.training.frames.windows import Windows
from tacdata.training.inference.compute import reproducible
from tacdata.training.networks.network import Network

BATCH = 256
"""Frames computed together."""


@torch.inference_mode()
def predict(network: Network, windows: Windows, frames: np.ndarray, depth_max: float) -> np.ndarray:
    """Return depth maps [mm], shape (m, pixels_x, pixels_y), float32, of the frames numbered ``frames`` (m,).

    Maps are clipped to 0 ... D_max, the range that labels are clipped to.
    """
    network.eval()
    device = windows.taxels.device
    result = np.empty((len(frames), *network.map_shape), dtype=np.float32)
    for start in range(0, len(frames), BATCH):
        batch = torch.as_tensor(frames[start : start + BATCH]).to(device)
        maps = network(windows.batch(batch)).clamp(0.0, 1.0) * depth_max
        result[start : start + BATCH] = maps.cpu().numpy()
    return result


def deviations(network: Network, windows: Windows, frames: np.ndarray) -> np.ndarray | None:
    """Return the deviation of the network's Gaussian process [1], shape (m,): larger away from the presses it knows.

    None if the network has no such process (`training.frames.peak_process`).
    """
    process = network.peak
    return process.answers(network, windows, frames)[1] if isinstance(process, PeakProcess) else None


@torch.inference_mode()
def milliseconds_per_frame(network: Network, windows: Windows, repeats: int = 200) -> float:
    """Return the median time [ms] of one frame at a time, window gathered, on one CPU thread.

    The network and the windows must lie on the CPU.
    """
    network.eval()
    times = []
    with reproducible(threads=1):
        for step in range(repeats + 20):
            frame = torch.tensor([step % len(windows)])
            began = time.perf_counter()
            network(windows.batch(frame))
            times.append(time.perf_counter() - began)
    # The first calls allocate memory.
    return 1e3 * float(np.median(times[20:]))
