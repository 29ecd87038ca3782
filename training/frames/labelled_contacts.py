"""Frames of labelled presses in contact, as the process of maxima (`peak_process.py`) learns from them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from tacdata.training.frames import ridge
from tacdata.training.frames.contact_features import SHALLOW, features
from tacdata.training.frames.windows import Windows

if TYPE_CHECKING:
    from tacdata.training.frames.frames import Frames
    from tacdata.training.networks.network import Network

LEAST = 0.06
"""Labelled maximum from which a frame counts [mm]: below, noise decides the region."""
FRAMES = 40
"""Frames of a press that are taken at most, evenly [count]."""
ROWS = 1000
"""Frames of all presses together that are taken at most [count]: time and memory grow with its square."""
BATCH = 256
"""Frames computed together [count]."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Frames of labelled presses in contact, as a process learns from them."""

    values: torch.Tensor
    """Their features [1], shape (n, features)."""
    target: torch.Tensor
    """Logarithms of labelled over predicted maximum [1], shape (n,)."""
    peak: torch.Tensor
    """Labelled maxima [mm], shape (n,)."""
    press: np.ndarray
    """Press of each frame [number], shape (n,)."""
    centers: torch.Tensor
    """Places of the taxels [mm], shape (taxels, 2)."""
    origin: Network | None
    """The network before the fit, of which the maps are; None if they are those of the network itself."""
    regressed: torch.Tensor
    """Maxima over D_max of ridge regressions without each frame's press [1], shape (n,)."""
    products: np.ndarray
    """Products of readings and labels of the presses (`ridge.products`)."""
    top: float
    """D_max [mm]."""

    def without(self, presses: tuple[int, ...], frames: Frames) -> Contacts:
        """Return the frames of the other presses."""
        others = np.flatnonzero(~np.isin(self.press, presses))
        kept = {
            name: getattr(self, name)[torch.from_numpy(others)] for name in ("values", "target", "peak", "regressed")
        }
        return replace(self, **kept, press=self.press[others], products=self.products - ridge.products(frames, presses))


@torch.inference_mode()
def contacts(network: Network, frames: Frames, presses: tuple[int, ...], origin: Network | None = None) -> Contacts:
    """Return the frames of presses that a process learns from.

    Args:
        network: The network that is corrected, on the CPU or a GPU; a correction that it has is left out.
        frames: The dataset.
        presses: Numbers of the presses.
        origin: The network before the fit, on the same device.
    """
    place = network.get_buffer("mean").device
    windows, top = Windows(frames, network.offsets, place), frames.sensor.map.depth_max
    centers = torch.as_tensor(np.float32(frames.sensor.taxels.centers), device=place)
    used, most, rows = origin or network, max(2, min(FRAMES, ROWS // len(presses))), []
    for press in presses:
        touching = frames.indices((press,))
        touching = touching[frames.depth[touching].max(axis=(1, 2)) > LEAST]
        rows.append(touching[:: -(-len(touching) // most) or 1])
    chosen, press = np.concatenate(rows), np.repeat(presses, [len(part) for part in rows])
    thinning = -(-len(chosen) // ROWS) or 1
    chosen, press = chosen[::thinning], press[::thinning]
    peak = torch.from_numpy(np.clip(frames.depth[chosen].max(axis=(1, 2)), 0.0, top).astype(float))
    values, maxima = [], []
    for batch in torch.as_tensor(chosen).split(BATCH):
        readings = windows.batch(batch.to(place))
        signals = network.calibrated(readings)
        depth = used.respond(signals)
        columns, largest = features(depth, signals, used, centers)
        if origin is not None:
            largest = prior_maxima(largest, depth, signals, origin, network.newest(readings))
        values.append(columns.double().cpu())
        maxima.append(largest.double().cpu())
    target = (peak / top / torch.cat([*maxima, peak.new_empty(0)])).log()
    products, regressed = ridge.products(frames, presses), np.empty(len(chosen))
    for number in np.unique(press):
        own = press == number
        regression = ridge.regression(products - ridge.products(frames, (number,)))
        regressed[own] = ridge.predicted(frames.taxels[chosen[own]], regression).max(axis=1)
    return Contacts(
        torch.cat([*values, peak.new_empty(0, 0)][: len(values) or 1]),
        target,
        peak,
        press,
        centers,
        origin,
        torch.from_numpy(regressed / top).clamp(min=SHALLOW),
        products,
        top,
    )


def prior_maxima(
    largest: torch.Tensor, depth: torch.Tensor, signals: torch.Tensor, origin: Network, counts: torch.Tensor
) -> torch.Tensor:
    """Return the maxima of the network before the fit (b,), by its own correction if it has one: the prior's mean."""
    if origin.peak is None:
        return largest
    return origin.peak.corrected(depth, signals, origin, counts).amax(dim=(1, 2)).clamp(min=SHALLOW)
